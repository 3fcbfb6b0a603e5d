"""This module contains kernels that evaluate a model function at many points in one call."""

from __future__ import annotations

from typing import Any

from hybridsim.engine.native.kernels import call, kernel


@kernel
def evaluate(function: Any, t: float, x: Any, p: Any, z: Any, out: Any) -> None:
    """Evaluate a model function once and write the result to `out`."""
    call(function, t, x, p, z, out)


@kernel
def evaluate_rows(function: Any, times: Any, states: Any, p: Any, z: Any, out: Any) -> None:
    """Evaluate out[k] = function(times[k], states[k]) for every row k."""
    for k in range(times.shape[0]):
        call(function, times[k], states[k], p, z, out[k])
