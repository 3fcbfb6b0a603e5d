"""This package contains the fixed-step methods: the published ones and Moreau-Jean time stepping."""
