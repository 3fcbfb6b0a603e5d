"""Mechanical systems with many dry contacts as data: matrices, contact directions and laws for compiled kernels."""
