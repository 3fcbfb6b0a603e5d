"""This package differentiates readings of a run: first the points of its extreme values, then the readings."""
