"""This folder cuts the points of a sweep into pieces of work, which an executor measures.

Start with `measure`.
"""
