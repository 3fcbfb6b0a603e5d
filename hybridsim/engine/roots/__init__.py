"""This package finds the first zero of a guard in a step, with an error bound.

Start with `roots` (any dense output) and `first_exit` (one polynomial).
"""
