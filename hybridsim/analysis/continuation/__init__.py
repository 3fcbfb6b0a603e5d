"""This package follows branches of periodic orbits over a parameter, including unstable orbits."""

from hybridsim.analysis.continuation.branch import Branch, BranchPoint
from hybridsim.analysis.continuation.continuation import continuation

__all__ = ["Branch", "BranchPoint", "continuation"]
