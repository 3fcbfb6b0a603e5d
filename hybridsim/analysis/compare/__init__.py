"""This folder measures errors and costs of integrators at several settings, against one common reference.

Start with `compare`, then `timed_runs` and `errors_against_reference`.
"""
