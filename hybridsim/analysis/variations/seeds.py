"""This module builds the derivatives of all arguments of the formulas: states, time, parameters."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.engine.series.dual_numbers import differentiated, values_and_slopes, with_slopes
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System


def rate_slopes(system: System, at: Instant) -> np.ndarray:
    """Return the derivatives (R, P) of the angular rates of the forcing by the parameters."""
    layout, module = system.layout, system.code.module
    P = layout.parameters
    p: list[Any] = list(system.vector(at, np.zeros(layout.discrete)))
    p[:P] = with_slopes(p[:P], np.eye(P))
    out: list[Any] = [0.0] * layout.phases
    differentiated(module.rates)(0.0, [], p, [], out)
    return values_and_slopes(out, P)[1]


def seeds(system: System, origin: float, rates: np.ndarray) -> np.ndarray:
    """Return the derivatives of all arguments of the formulas by states, local time and parameters.

    rates: the result of `rate_slopes`.
    """
    layout, n = system.layout, system.n
    P, d = layout.parameters, layout.discrete
    found = np.zeros((n + 1 + layout.size, n + 1 + d + P))
    found[: n + 1, : n + 1] = np.eye(n + 1)
    found[n + 1 + layout.discrete_at : n + 1 + layout.discrete_at + d, n + 1 : n + 1 + d] = np.eye(d)
    found[n + 1 : n + 1 + P, n + 1 + d :] = np.eye(P)
    for k, row in enumerate(rates):  # an angle rate*origin
        found[n + 1 + layout.phases_at + k, n + 1 + d :] = origin * row
    return found
