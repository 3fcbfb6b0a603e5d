"""SciPy's solvers run here, with events located by the engine or by `solve_ivp` itself."""
