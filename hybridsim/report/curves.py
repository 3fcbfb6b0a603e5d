"""This module chooses the quantities of a report and stores their curves within a limited size."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybridsim.model import Model
from hybridsim.model.checks.units import units_of
from hybridsim.plot.shared.scale import scaled_unit
from hybridsim.report.embedded import array, numbers
from hybridsim.report.sampling import Sampler
from hybridsim.solution import Solution
from hybridsim.solution.run_trajectory import relative_velocity

Array = NDArray[np.float64]

_MOST_QUANTITIES, _MOST_STATES, _MOST_OUTPUTS, _MOST_CONTACTS = 24, 10, 6, 4
_SHOWN = 4  # quantities whose curves the page opens with, of states and of outputs each
_LEAST_BINS, _MOST_BINS = 2048, 8192  # more than the page has pixels across
_OF_BINS = 0.5  # part of the size that the ranges may take; the first and last part of the run take the rest
_BASE64 = 4 / 3
_TRIAL = 400  # steps that show how many samples a step needs
_PARTS = 16  # of a step, for the ranges
_FINE = 8000  # parts of a whole run, beyond which its steps are not divided
_CHUNK = 20_000


def quantities_of(solution: Solution) -> list[str]:
    """Return the names of the quantities in a report: states, forces and velocities of contacts, and outputs."""
    model: Model = solution.model
    known = {*solution.names, *solution.quantities}
    contacts = [contact.name for contact in model.contacts][:_MOST_CONTACTS]
    outputs = [output.name for output in model.outputs][:_MOST_OUTPUTS]
    names = [*solution.names[:_MOST_STATES], *outputs, *contacts, *map(relative_velocity, contacts)]
    return [name for name in dict.fromkeys(names) if name in known][:_MOST_QUANTITIES]


def curves_of(solution: Solution, size: int) -> dict[str, Any]:
    """Return the curves of a run for the page, in about `size` bytes.

    If the samples of the whole run fit, ``parts`` has one part. Otherwise ``ranges`` has the least and the largest
    value of each quantity in equal bins of time, and ``parts`` the samples of the first and of the last part.
    """
    names = quantities_of(solution)
    sampler = Sampler(solution, names)
    steps, point = sampler.steps, _BASE64 * (8 + 4 * len(names))
    most = int(size / point)
    ranges = None
    divided = int(np.clip(_FINE // len(steps), 1, 4))  # parts of each step
    if 2 * divided * len(steps) <= most:
        parts = [sampler.along(steps, most, divided)]
        low, high = _extent([values for _, values in parts])
    else:
        bin_size = _BASE64 * 8 * len(names)
        bins = int(np.clip(_OF_BINS * size / bin_size, _LEAST_BINS, _MOST_BINS))
        lows, highs = ranges_in(sampler, bins)
        ranges = {"low": [numbers(row) for row in lows], "high": [numbers(row) for row in highs]}
        low, high = _extent([lows, highs])
        share = max(int((size - bins * bin_size) / point / 2), 64)
        usual = [
            len(sampler.along(knots)[0]) / (len(knots) - 1) for knots in (steps[:_TRIAL], steps[-_TRIAL:])
        ]
        first, last = (max(int(0.9 * share / points), 1) for points in usual)
        parts = [sampler.along(knots) for knots in (steps[: first + 1], steps[-last - 1 :])]
    return {
        "quantities": _described(solution, names, low, high),
        "ranges": ranges,
        "parts": [{"t": array(t, "f8"), "values": [numbers(row) for row in values]} for t, values in parts],
    }  # fmt: skip


def ranges_in(sampler: Sampler, bins: int) -> tuple[Array, Array]:
    """Return the least and the largest value (n, bins) of each quantity in equal bins of time, including both ends."""
    edges = np.linspace(sampler.steps[0], sampler.steps[-1], bins + 1)
    knots = np.union1d(sampler.steps, edges)
    low = np.full((len(sampler.names), bins), np.nan)
    high = low.copy()
    for first in range(0, len(knots) - 1, _CHUNK):
        chosen = knots[first : first + _CHUNK + 1]
        t, values = sampler.along(chosen, parts=_PARTS, deepest=1)
        b0 = max(int(np.searchsorted(edges, chosen[0], side="right")) - 1, 0)
        b1 = min(int(np.searchsorted(edges, chosen[-1], side="left")), bins)
        starts = np.searchsorted(t, edges[b0:b1], side="left")
        ends = np.searchsorted(t, edges[b0 + 1 : b1 + 1], side="right")
        slices = np.column_stack([starts, ends]).ravel()
        values = np.append(values, np.full((len(values), 1), np.nan), axis=1)
        low[:, b0:b1] = np.fmin(low[:, b0:b1], np.fmin.reduceat(values, slices, axis=1)[:, ::2])
        high[:, b0:b1] = np.fmax(high[:, b0:b1], np.fmax.reduceat(values, slices, axis=1)[:, ::2])
    return low, high


def _extent(tables: list[Array]) -> tuple[Array, Array]:
    """Return the least and the largest finite value of each row of several tables."""
    values = np.concatenate(tables, axis=1)
    is_finite = np.isfinite(values)
    low = np.where(is_finite, values, np.inf).min(axis=1)
    high = np.where(is_finite, values, -np.inf).max(axis=1)
    has_any = is_finite.any(axis=1)
    return np.where(has_any, low, 0.0), np.where(has_any, high, 0.0)


def _described(solution: Solution, names: list[str], low: Array, high: Array) -> list[dict[str, Any]]:
    """Return for each quantity its name, unit with prefix, range, and whether the page shows its curve at first."""
    model: Model = solution.model
    units = units_of(model)
    units |= {relative_velocity(c.name): units.get(c.velocity.text, "") for c in model.contacts}
    opened = [*solution.names[:_SHOWN], *[output.name for output in model.outputs][:_SHOWN]]
    found = []
    for name, least, most in zip(names, low.tolist(), high.tolist(), strict=True):
        power, unit = scaled_unit(units.get(name, ""), least, most)
        has_power = bool(power) and unit == units.get(name, "")  # a unit without a prefix
        found.append(
            {
                "name": name, "unit": unit, "power": power, "has_power": has_power, "low": least, "high": most,
                "shown": name in opened,
            }
        )  # fmt: skip
    return found
