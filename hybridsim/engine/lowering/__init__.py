"""This package converts the expressions of a model to a program, and to instructions for kernels.

Besides `expr` this is the only folder that imports SymPy. Start with `program`, then `lower` and `emit`.
"""
