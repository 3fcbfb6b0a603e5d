"""This folder compares integrators: error and cost of each at several settings, against one reference.

Start with `compare`, then `timed_runs` and `errors_against_reference`.
"""
