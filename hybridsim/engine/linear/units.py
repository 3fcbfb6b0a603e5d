"""This module scales linear modes so that inputs with short intervals cause no large numbers."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from hybridsim.engine.linear.form import TIME, VALUE
from hybridsim.engine.linear.modal import Modals, modals
from hybridsim.engine.native.constants import BOUND_TERMS
from hybridsim.engine.native.simd.products import LANES
from hybridsim.engine.series.layout import SIGNAL_SLOTS
from hybridsim.engine.system.known_times import START


@lru_cache(64)
def horizon_class(horizon: float) -> float:
    """Round a segment length up to a power of 16; tables are computed for this length."""
    return 16.0 ** math.ceil(math.log(horizon, 16.0)) if horizon > 0.0 else math.inf


def scaled_modals(
    A: np.ndarray, units: np.ndarray | None, horizon: float, least: int = 0
) -> tuple[Modals, int]:
    """Return the result of `modals` for matrices (K, m, m), computed in the units (K, m) of their variables."""
    if units is None:
        return modals(A, horizon, BOUND_TERMS, multiple=LANES // 2, least=least)
    scaled = A * units[:, None, :] / units[:, :, None]
    flows, widest = modals(scaled, horizon, BOUND_TERMS, multiple=LANES // 2, least=least)
    flows.full_basis[...] *= units[:, :, None]
    flows.inverse[...] /= units[:, None, :]
    return flows, widest


def units_of(atoms: tuple[np.ndarray, ...], A: np.ndarray, n: int, length: float) -> np.ndarray:
    """Return units (K, m) of the variables, so that inputs with short intervals cause no large rounding errors.

    A coefficient of a short piece is large, and its effect on a state is small. In other units the state would have an
    error relative to the coefficient. The units are powers of two, so that they cause no rounding errors.
    """
    units = np.zeros(A.shape[:2])
    units[:, n:] = length ** _powers_of_time(*atoms[:8])
    for unit, own, matrix in zip(units, A, np.abs(A), strict=True):
        fastest = np.abs(np.linalg.eigvals(own[:n, :n])).max(initial=0.0)
        reach = 1.0 / max(1.0 / length, fastest)
        while True:  # states that are driven by variables with units
            driven = np.where(unit[:n] == 0.0, reach * (matrix[:n] * unit).max(axis=1), 0.0)
            if not driven.any():
                break
            unit[:n] += driven
        unit[unit == 0.0] = 1.0
    return np.asarray(np.exp2(np.round(np.log2(units))))


def _powers_of_time(
    kinds: np.ndarray,
    rates: np.ndarray,
    offsets: np.ndarray,
    term_start: np.ndarray,
    sources: np.ndarray,
    weights: np.ndarray,
    factors: np.ndarray,
    angles: np.ndarray,
) -> np.ndarray:
    """Return the power of time in the unit of each monomial, such as -2 for a second derivative."""
    powers = np.zeros(2 * len(kinds) + 1, dtype=np.int64)
    for a, kind in enumerate(kinds):
        if kind == TIME:
            powers[2 * a] = 1
        elif kind == VALUE and sources[term_start[a]] >= angles[1]:
            slot = (sources[term_start[a]] - angles[1]) % SIGNAL_SLOTS
            powers[2 * a] = -slot if slot < START else slot == START
    return np.asarray(powers[factors].sum(axis=1))
