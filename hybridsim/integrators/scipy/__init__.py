"""This package runs SciPy's solvers, with events located by the engine or by `solve_ivp` itself."""
