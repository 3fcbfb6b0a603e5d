"""This package simulates mechanical systems by Moreau-Jean time stepping.

Start with `run`.
"""
