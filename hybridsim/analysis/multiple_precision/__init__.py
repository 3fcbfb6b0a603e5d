"""A second opinion on a run: a hybrid Taylor integrator in multiple precision that decides events by itself."""

from __future__ import annotations

from hybridsim.analysis.multiple_precision.trajectory import multiple_precision_trajectory

__all__ = ["multiple_precision_trajectory"]
