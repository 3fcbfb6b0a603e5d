"""This folder runs models whose rates are Python functions: compiled where numba can, else called.

Start with `forms`, then `compiled` and `code`.
"""
