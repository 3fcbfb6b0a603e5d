"""The error control of a run: relative and absolute tolerances and bounds of the step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Tolerances:
    """Error control of a run: tolerances and bounds of the step."""

    rtol: float
    atol: np.ndarray  # (n,)
    max_step: float = np.inf
    first_step: float | None = None
