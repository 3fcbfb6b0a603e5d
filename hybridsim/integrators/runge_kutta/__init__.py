"""This package contains explicit embedded Runge-Kutta methods, each defined by a tableau and a name.

Start with `method`, then `dop853` or `tsit5`. `segments` is the compiled loop.
"""

from hybridsim.integrators.runge_kutta.method import RungeKuttaStepper, Tableau

__all__ = ["RungeKuttaStepper", "Tableau"]
