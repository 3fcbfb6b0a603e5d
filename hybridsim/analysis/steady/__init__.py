"""This package finds steady motions, by following a run and by Newton's method, and measures one period of them."""

from hybridsim.analysis.steady.result import SteadyState
from hybridsim.analysis.steady.steady_state import steady_state

__all__ = ["SteadyState", "steady_state"]
