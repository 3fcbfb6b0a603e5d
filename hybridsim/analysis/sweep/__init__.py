"""This package measures a model at many values of its parameters, on threads or on any executor."""

from hybridsim.analysis.sweep.bifurcation import bifurcation
from hybridsim.analysis.sweep.frequency_response import frequency_response
from hybridsim.analysis.sweep.result import Sweep
from hybridsim.analysis.sweep.sweep import sweep

__all__ = ["Sweep", "bifurcation", "frequency_response", "sweep"]
