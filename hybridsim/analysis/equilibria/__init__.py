"""This package finds the equilibria and the steady sliding of a model, and its linearisation there."""

from hybridsim.analysis.equilibria.equilibria import Equilibrium, equilibria
from hybridsim.analysis.equilibria.linearize import Linearization, linearize

__all__ = ["Equilibrium", "Linearization", "equilibria", "linearize"]
