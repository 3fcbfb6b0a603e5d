"""This package saves solutions as archives and tables, and loads archives after checks.

Start with `archive`.
"""
