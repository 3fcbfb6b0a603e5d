"""This folder saves solutions to files and loads them: archives that are checked on reading, and tables.

Start with `archive`.
"""
