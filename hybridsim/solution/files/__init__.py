"""This package saves solutions to files and loads them: archives that are checked, and tables.

Start with `archive`.
"""
