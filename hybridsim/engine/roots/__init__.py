"""This folder isolates the first zero of a guard along a step, with an error bound.

Start with `roots` (any dense output) and `first_exit` (one polynomial).
"""
