"""This folder measures errors and costs of integrators at several settings, with one reference for all.

Start with `compare`, then `timed_runs` and `errors_against_reference`.
"""
