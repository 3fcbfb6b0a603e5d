"""This package checks the units of all expressions of a model, without converting values.

Start with `unit` and `parse`, then read `infer`, which walks over expressions, `quantities` and `faults`.
"""
