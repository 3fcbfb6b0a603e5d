"""This package turns the drawing of a model into outlines and lines at given times."""
