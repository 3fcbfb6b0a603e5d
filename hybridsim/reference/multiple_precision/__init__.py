"""This package gives an independent reference run: a hybrid Taylor integrator in multiple precision."""

from __future__ import annotations

from hybridsim.reference.multiple_precision.trajectory import multiple_precision_trajectory

__all__ = ["multiple_precision_trajectory"]
