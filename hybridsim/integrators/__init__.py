"""This package contains the integrators: one folder per family of methods, and one registry for all.

`contract` defines the interface of an integrator. A new method is a new folder and a line in `registry`.
"""

from hybridsim.integrators.registry import integrator_class, list_integrators, make_integrator

__all__ = ["integrator_class", "list_integrators", "make_integrator"]
