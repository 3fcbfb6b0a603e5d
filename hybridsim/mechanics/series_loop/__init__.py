"""This folder runs mechanical systems by Taylor series, and chooses the modes of all contacts jointly.

Start with `run`, then `loop` (the compiled loop) and `decision`.
"""
