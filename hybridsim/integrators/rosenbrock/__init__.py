"""This package contains Rosenbrock methods for stiff modes, each defined by a tableau and a name."""
