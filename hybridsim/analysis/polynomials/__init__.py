"""This package represents a part of a run by polynomials on intervals between its events."""
