"""This module computes short Taylor series at a point, from which events are resolved."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Series(NamedTuple):
    """Taylor coefficients of states, guards, surfaces and monitors up to third order, with error bounds."""

    states: np.ndarray
    state_bounds: np.ndarray
    guards: np.ndarray
    guard_bounds: np.ndarray
    surfaces: np.ndarray
    surface_bounds: np.ndarray
    monitors: np.ndarray
    monitor_bounds: np.ndarray
