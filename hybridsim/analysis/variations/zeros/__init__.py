"""This package follows functions that stay zero along a run, and finds corners in resets."""
