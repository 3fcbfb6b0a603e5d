"""This package computes derivatives of the values in formulas: parameters, then inputs, then the run-time vector."""
