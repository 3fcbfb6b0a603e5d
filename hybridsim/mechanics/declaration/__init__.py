"""This package declares mechanical systems with many contacts, and contains known examples.

Start with `system`.
"""
