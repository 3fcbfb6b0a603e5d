"""This folder runs mechanical systems by Taylor series, and decides all contacts together at events.

Start with `run`, then `loop` (the compiled loop) and `decision`.
"""
