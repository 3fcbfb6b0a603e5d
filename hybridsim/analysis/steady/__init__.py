"""This package finds the steady motion of a model and measures it over one period."""

from hybridsim.analysis.steady.result import SteadyState
from hybridsim.analysis.steady.steady_state import steady_state

__all__ = ["SteadyState", "steady_state"]
