"""This folder declares mechanical systems with many contacts, and has known systems of this kind.

Start with `system`.
"""
