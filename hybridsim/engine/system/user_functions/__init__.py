"""This package runs models of Python functions, compiled by numba if possible.

Start with `forms`, then `compiled` and `code`.
"""
