"""Short Taylor series along a flow, by which events are decided."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Series(NamedTuple):
    """Taylor coefficients of states, guards, surfaces and monitors (., 4), with bounds of their rounding errors."""

    states: np.ndarray
    state_bounds: np.ndarray
    guards: np.ndarray
    guard_bounds: np.ndarray
    surfaces: np.ndarray
    surface_bounds: np.ndarray
    monitors: np.ndarray
    monitor_bounds: np.ndarray
