"""Rosenbrock methods, for stiff modes, share this folder: a method is a tableau and a name."""
