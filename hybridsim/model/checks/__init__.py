"""This folder checks whether a declaration holds together, and collects all faults.

Start with `validate`, which calls the others, and `scope`, which they share.
"""
