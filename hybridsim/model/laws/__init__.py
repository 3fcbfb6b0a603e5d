"""Friction laws give a force as a function of velocity and load and, where a law remembers, of states.

Start with `law`.
"""
