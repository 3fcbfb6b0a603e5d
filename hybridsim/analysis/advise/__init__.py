"""This package finds the simplest model and the cheapest integrator that answer a question within a tolerance."""

from hybridsim.analysis.advise.advice import Advice
from hybridsim.analysis.advise.advise import advise

__all__ = ["Advice", "advise"]
