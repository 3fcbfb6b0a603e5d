"""Bounces so low that rounding hides them: where they come to their end.

With gap' = u > 0 after a bounce, and gap'' = -g, the flight takes 2 u/g; the next ones take e, e**2, ... of it, with e
the ratio of the speeds after and before: together 2 u/(g (1 - e)). An error h of the gap changes the first term by h/u,
so the last bounces tell least; the first ones miss how g and e change meanwhile. The forecast is that of the first
bounce with which all later ones agree within their errors (Lepski's rule, Theory Probab. Appl. 35 (1991) 454,
doi:10.1137/1135065).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import NamedTuple

import numpy as np

from hybridsim.engine.accumulation import Limit
from hybridsim.engine.jets import UNIT
from hybridsim.engine.outcome import Outcome
from hybridsim.engine.system import Series, System
from hybridsim.engine.timepair import Instant
from hybridsim.engine.trajectory import Trajectory

_FARTHEST = 4096  # bounces that are looked back on
_STRIDE = 1.5  # ratio of the speeds of those that are looked at


class Forecast(NamedTuple):
    """When the bounces of a contact end, as told by one of them, how well that is known, and its time of flight."""

    limit: float
    error: float
    flight: float


class Bounced(NamedTuple):
    """An impact: when, and the states on both sides of it."""

    instant: Instant
    x_minus: np.ndarray
    x_plus: np.ndarray


def limit_of_hidden(
    system: System, outcome: Outcome, p: np.ndarray, now: Bounced, record: Trajectory
) -> Limit | None:
    """The limit of the contacts that have just bounced so low that no gap can be seen to open; None if there is none.

    Impacts that follow are not to be told from rest: no gap can be found to close that was never seen to open.
    """
    automata = system.automata
    bounced = {
        c.component
        for c in outcome.changes
        if automata[c.component].is_unilateral and automata[c.component].hold not in (c.source, c.target)
    }
    if not bounced:
        return None
    series = _series(system, outcome, now.x_plus, p)
    found = {}
    for k, c in enumerate(system.surface_of):
        (_, rate, curve), bound = series.surfaces[k, :3].tolist(), float(series.surface_bounds[k, 0])
        # the square of the rate is 4 |curve| times the height
        if c in bounced and curve < 0.0 < rate and rate**2 <= -4.0 * curve * bound:
            found[c] = _agreed(system, outcome, k, now, record) or Forecast(
                float(now.instant.plus(-rate / curve)), 0.0, -rate / curve
            )
    if not found:
        return None
    passed = max(forecast.flight for forecast in found.values())
    return Limit(max(forecast.limit for forecast in found.values()), tuple(found), passed)


def _agreed(
    system: System, outcome: Outcome, surface: int, now: Bounced, record: Trajectory
) -> Forecast | None:
    """The forecast of the first bounce that all later ones agree with; None where the last one tells nothing."""
    best, slowest = None, 0.0
    for bounced in _backward(system, surface, now, record):
        after = _series(
            system, outcome, bounced.x_plus, system.vector(bounced.instant, system.discrete(outcome.p))
        )
        rate = float(after.surfaces[surface, 1])
        if best is not None and 0.0 < rate < slowest:
            continue
        slowest = _STRIDE * rate
        forecast = _forecast(system, outcome, surface, bounced, after)
        if forecast is None or (best is not None and abs(forecast.limit - best.limit) > best.error):
            break
        best = forecast if best is None else forecast._replace(flight=best.flight)
    return best


def _forecast(
    system: System, outcome: Outcome, surface: int, bounced: Bounced, after: Series
) -> Forecast | None:
    p = system.vector(bounced.instant, system.discrete(outcome.p))
    approach = float(_series(system, outcome, bounced.x_minus, p).surfaces[surface, 1])
    (_, rate, curve), bound = after.surfaces[surface, :3].tolist(), float(after.surface_bounds[surface, 0])
    restitution = -rate / approach if approach else 0.0
    if not (curve < 0.0 < rate and 0.0 < restitution < 1.0):
        return None
    flight = -rate / curve
    rest = flight / (1.0 - restitution)
    limit = float(bounced.instant.plus(rest))
    return Forecast(limit, rest * min(1.0, -4.0 * curve * bound / rate**2) + 4.0 * UNIT * abs(limit), flight)


def _backward(system: System, surface: int, now: Bounced, record: Trajectory) -> Iterator[Bounced]:
    """The bounces of a contact, the last one first, until one of another kind."""
    automaton = system.automata[system.surface_of[surface]]
    yield now
    last = (block[i] for block in reversed(record.occurrences.blocks) for i in range(len(block) - 1, -1, -1))
    for o in islice(last, _FARTHEST):
        if o.component != automaton.name or o.instant == now.instant:
            continue
        if automaton.modes[automaton.hold] in (o.source, o.target):
            return
        yield Bounced(o.instant, o.x_minus, o.x_plus)


def _series(system: System, outcome: Outcome, x: np.ndarray, p: np.ndarray) -> Series:
    series = system.series(0.0, x, p, outcome.z, outcome.x_error + 4.0 * UNIT * np.abs(x), 0.0)
    assert isinstance(series, Series)  # models with impacts are made from expressions
    return series
