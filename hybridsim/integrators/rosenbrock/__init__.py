"""This package contains Rosenbrock methods for stiff modes, each of which is a tableau and a name."""
