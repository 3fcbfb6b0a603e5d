"""The integrators: each family is one folder, and all are reached through one registry.

`contract` says what an integrator has to offer. A new method is a new folder and a line in `registry`.
"""

from hybridsim.integrators.registry import integrator_class, list_integrators, make_integrator

__all__ = ["integrator_class", "list_integrators", "make_integrator"]
