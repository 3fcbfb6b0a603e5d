"""This folder recognises modes that are linear in the states, and gives their motion in closed form.

Start with `form` and `modes` (when a mode is linear), then `tables` and `motion`.
"""
