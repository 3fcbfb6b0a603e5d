"""This package contains the fixed-step methods: the published methods and Moreau-Jean time stepping."""
