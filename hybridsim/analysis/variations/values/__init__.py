"""This package computes derivatives of all values in a model's formulas, such as parameters and inputs."""
