"""Methods with a fixed step, which decide events themselves: the published ones and Moreau-Jean time stepping."""
