"""The integrators: one file a family, all reached through one registry."""

from hybridsim.integrators.registry import integrator_class, list_integrators, make_integrator

__all__ = ["integrator_class", "list_integrators", "make_integrator"]
