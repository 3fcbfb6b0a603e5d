"""This folder keeps solutions in files: archives that are checked when they are read, and tables.

Start with `archive`.
"""
