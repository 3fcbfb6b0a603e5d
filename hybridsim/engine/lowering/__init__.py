"""This folder converts the expressions of a model to a program and to the tapes that kernels read.

Besides `expr` this is the only folder that imports SymPy. Start with `program`, then `lower` and `emit`.
"""
