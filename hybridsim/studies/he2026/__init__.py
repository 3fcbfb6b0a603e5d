"""This package reproduces the study by He et al. (2026) of an RK4 method with bisection."""
