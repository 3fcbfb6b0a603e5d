"""Branches of periodic orbits over a parameter, those that repel included."""

from hybridsim.analysis.continuation.branch import Branch, BranchPoint
from hybridsim.analysis.continuation.continuation import continuation

__all__ = ["Branch", "BranchPoint", "continuation"]
