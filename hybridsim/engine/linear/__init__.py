"""This package detects modes that are linear in the states, and computes their motion in closed form.

Start with `form` and `modes` (conditions for a linear mode), then `tables` and `motion`.
"""
