"""This folder divides the points of a sweep into batches, which an executor runs.

Start with `measure`.
"""
