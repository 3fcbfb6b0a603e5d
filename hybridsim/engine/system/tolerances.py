"""This module defines the tolerances of a run and the bounds of its step size."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Tolerances(NamedTuple):
    """The tolerances of a run and the bounds of its step size."""

    rtol: float
    atol: np.ndarray  # (n,)
    max_step: float = np.inf
    first_step: float | None = None
