"""This package writes elements of control loops, and guards with a direction, as automata and other parts.

Start with `element` (what one declares), then `forms`.
"""
