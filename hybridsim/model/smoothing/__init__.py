"""This package turns corners and jumps in expressions into components, so that every mode is smooth.

Start with `explicit_corners`.
"""
