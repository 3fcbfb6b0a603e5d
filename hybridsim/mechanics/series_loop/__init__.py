"""This package simulates mechanical systems by Taylor series, and chooses the modes of contacts jointly.

Start with `run`, then `loop` (the compiled loop) and `decision`.
"""
