"""This package finds equilibria and steady sliding motions of a model, and linearises about them."""

from hybridsim.analysis.equilibria.equilibria import Equilibrium, equilibria
from hybridsim.analysis.equilibria.linearize import Linearization, linearize

__all__ = ["Equilibrium", "Linearization", "equilibria", "linearize"]
