"""This folder runs mechanical systems by Moreau-Jean time stepping.

Start with `run`.
"""
