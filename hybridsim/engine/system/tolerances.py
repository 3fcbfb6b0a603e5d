"""This module defines the tolerances of a run and the bounds of its step size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Tolerances:
    """The tolerances of a run and the bounds of its step size."""

    rtol: float
    atol: np.ndarray  # (n,)
    max_step: float = np.inf
    first_step: float | None = None
