"""Steady motion: found by following a run and by Newton's method, measured over one period."""

from hybridsim.analysis.steady.result import SteadyState
from hybridsim.analysis.steady.steady_state import steady_state

__all__ = ["SteadyState", "steady_state"]
