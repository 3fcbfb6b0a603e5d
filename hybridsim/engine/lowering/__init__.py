"""This folder turns the expressions of a model into a program and into the tapes that kernels read.

Beside `expr` this is the only folder that imports SymPy. Start with `program`, then `lower` and `emit`.
"""
