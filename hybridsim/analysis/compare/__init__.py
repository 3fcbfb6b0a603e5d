"""This package measures errors and costs of integrators at several settings, against a common reference.

Start with `compare`, then `timed_runs` and `errors_against_reference`.
"""
