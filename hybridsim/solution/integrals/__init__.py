"""This package integrates quantities over a run, and balances the energies of a run."""
