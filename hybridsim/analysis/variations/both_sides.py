"""This module compares the derivatives on the two sides of a guard or surface that a run touches."""

from __future__ import annotations

import numpy as np

from hybridsim.analysis.variations.carried import Carrier
from hybridsim.analysis.variations.directions import Carried, Directions
from hybridsim.errors import UsageError

_AGREE = 1e-7  # of their sizes: derivatives on both sides that differ by less are equal
_ROUNDING = 1e-11  # of the states' sizes, for a change of everything by its own size


def agreed(
    carrier: Carrier, directions: Directions, carried: Carried
) -> tuple[np.ndarray, np.ndarray, list[tuple[str, np.ndarray]]]:
    """Return derivatives at the end (n + d, M) and of event times (E, M), and why some of them are NaN.

    carried: the derivatives on the side of the run, with the functions that are exactly at zero. Each
    direction that moves one of these off zero is carried forward and backward, on its own side. The last part
    of the result names these functions, with a mask (M,) of the directions along which the sides differ.
    """
    end = np.concatenate([carried.x, carried.discrete])
    width = end.shape[1]
    times = np.array([shift for _, shift in carried.times]).reshape(len(carried.times), width)
    moves = np.any([one.moves for one in carried.off], axis=0) if carried.off else np.zeros(width, dtype=bool)
    chosen = np.flatnonzero(moves)
    if not len(chosen):
        return end, times, []
    count = len(chosen)
    try:
        both = carrier.carry(directions.both_ways(chosen), sided=True)
    except UsageError:  # one event on the side of the run is several events on the other side
        end[:, chosen], times[:, chosen] = np.nan, np.nan
    else:
        lost = np.minimum(both.lost[:count], both.lost[count:])
        ends = np.concatenate([both.x, both.discrete])
        shifts = np.array([shift for _, shift in both.times]).reshape(len(times), 2 * count)
        sizes = carrier.sizes() / carrier.own_sizes(directions)[chosen]
        end[:, chosen] = _agreeing(ends[:, :count], -ends[:, count:], _ROUNDING * sizes, lost < np.inf)
        length = carrier.solution.t_end - carrier.solution.t_start
        at = np.array([t for t, _ in carried.times])
        least = _ROUNDING * length / carrier.own_sizes(directions)[chosen]
        times[:, chosen] = _agreeing(shifts[:, :count], -shifts[:, count:], least, at[:, None] > lost)
    differs = np.isnan(end).any(axis=0) | np.isnan(times).any(axis=0)
    parted = [
        (f"at t = {one.t:.9g} {one.name} is exactly at its zero", one.moves & differs) for one in carried.off
    ]
    return end, times, [(name, mask) for name, mask in parted if mask.any()]


def _agreeing(one: np.ndarray, other: np.ndarray, least: np.ndarray, lost: np.ndarray) -> np.ndarray:
    """Return the derivatives at which forward and backward directions agree, and NaN elsewhere."""
    apart = np.abs(one - other) > _AGREE * (np.abs(one) + np.abs(other)) + least
    return np.where(apart | lost, np.nan, 0.5 * (one + other))
