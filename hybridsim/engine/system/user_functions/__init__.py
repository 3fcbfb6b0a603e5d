"""This folder runs models of Python functions: compiled by numba if possible, else called from the engine.

Start with `forms`, then `compiled` and `code`.
"""
