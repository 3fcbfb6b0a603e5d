"""This package divides the points of a sweep into batches, and runs the batches on an executor.

Start with `measure`.
"""
