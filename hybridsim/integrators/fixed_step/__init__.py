"""Methods with a fixed step make their own decisions: the published ones and Moreau-Jean time stepping."""
