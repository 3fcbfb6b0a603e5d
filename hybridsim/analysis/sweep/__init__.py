"""Sweeps: one measure of a model over grids and lists of parameter values, on threads or any executor."""

from hybridsim.analysis.sweep.result import Sweep
from hybridsim.analysis.sweep.sweep import sweep

__all__ = ["Sweep", "sweep"]
