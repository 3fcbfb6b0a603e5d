"""How little model, and which integrator, is enough for a question and a tolerance."""

from hybridsim.analysis.advise.advice import Advice
from hybridsim.analysis.advise.advise import advise

__all__ = ["Advice", "advise"]
