"""This package defines friction laws: the force as a function of velocity, load and internal states.

Start with `law`.
"""
