"""This package checks that declarations are consistent, and collects all errors.

Start with `validate`, which calls the others, and `scope`, which they share.
"""
