"""Find the time at which bounces end, if rounding hides the last bounces.

A guard w leaves zero with w' = u > 0 and w'' = -g, for a flight of 2 u/g. The next flights last e, e**2, ... of it,
with e the ratio of the speeds after and before, so that they take 2 u/(g (1 - e)) in total. A bounce loses
(1 - e) u**2/g of the height. When this is less than rounding, later crossings are hidden by noise. An error h of w
changes all later times by h/u, so the last bounces are least accurate, while the first ones miss how g and e change
meanwhile. The forecast is that of the first bounce with which all later ones agree within their errors (Lepski's rule,
Theory Probab. Appl. 35 (1991) 454, doi:10.1137/1135065).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np

from hybridsim.engine.events.outcome import Outcome
from hybridsim.engine.events.zeno.accumulation import Limit
from hybridsim.engine.record.segments import Occurrence
from hybridsim.engine.record.trajectory import LOOKED_BACK_ON, Trajectory
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.series.short_series import Series
from hybridsim.engine.system.automaton import Automaton
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System

_STRIDE = 1.5  # ratio of the speeds of the examined bounces
LEAST_LOSS = 1e-4  # least relative loss of speed in a bounce; less means over 10**4 bounces per digit
_AGREEING_BOUNCES = 2  # bounces that have to agree if they are not impacts of a declared law


class Bounce(NamedTuple):
    """A bounce: a transition of a component, with its time."""

    instant: Instant
    source: int  # mode before
    guard: str  # name of the guard that fired
    target: int  # mode after
    x_minus: np.ndarray  # states (n,) before
    x_plus: np.ndarray  # states (n,) after


class _Departure(NamedTuple):
    """The motion of a guard as it leaves zero."""

    speed: float
    flight: float  # duration of the flight
    unknown: float  # fraction of the flight by which rounding moves its end


class _Forecast(NamedTuple):
    """A forecast of the time at which bounces end."""

    limit: float  # time of the end
    error: float  # its error bound
    hidden: float  # rounding relative to the loss of a bounce


def bounces_of(outcome: Outcome, now: Instant, x_minus: np.ndarray) -> dict[int, Bounce]:
    """Return the first transition of each component in the event that led to the present state."""
    found: dict[int, Bounce] = {}
    for change in outcome.changes:
        bounce = Bounce(now, change.source, change.guard, change.target, x_minus, outcome.x)
        found.setdefault(change.component, bounce)
    return found


def last_bounces(system: System, happened: Sequence[Occurrence]) -> dict[int, Bounce]:
    """Return the last recorded event as a bounce, by component; return an empty dict if no component had an event."""
    last = next((o for o in reversed(happened) if o.kind != "monitor"), None)
    components = [
        c for c, automaton in enumerate(system.automata) if last and automaton.name == last.component
    ]
    return {c: _recorded(system.automata[c], last) for c in components if last}


def _recorded(automaton: Automaton, o: Occurrence) -> Bounce:
    source, target = automaton.modes.index(o.source), automaton.modes.index(o.target)
    return Bounce(o.instant, source, o.guard, target, o.x_minus, o.x_plus)


def limit_of_hidden(
    system: System, outcome: Outcome, bounces: dict[int, Bounce], record: Trajectory
) -> Limit | None:
    """Return the time at which bounces end, and their components, if rounding hides further bounces."""
    found = {}
    for c, departure in _barely_seen(system, outcome, bounces).items():
        last = bounces[c]
        forecast = _forecast(system, outcome, c, last, departure)
        if forecast is not None and forecast.hidden >= 1.0:
            limit, count = _agreed(system, outcome, c, forecast, departure.speed, last, record)
            if system.automata[c].is_unilateral or count >= _AGREEING_BOUNCES:
                found[c] = (limit, departure.flight)
    if not found:
        return None
    limits, flights = zip(*found.values(), strict=True)
    return Limit(max(limits), tuple(found), max(flights))


def may_be_hidden(system: System, outcome: Outcome, happened: Sequence[Occurrence]) -> bool:
    """Return whether rounding may hide the bounces after the last event."""
    return bool(_barely_seen(system, outcome, last_bounces(system, happened)))


def _barely_seen(system: System, outcome: Outcome, bounces: dict[int, Bounce]) -> dict[int, _Departure]:
    """Return, by component, the start of a flight so short that rounding may hide how much speed it loses."""
    found = {}
    for c, last in bounces.items() if system.has_tape else ():
        automaton = system.automata[c]
        rests = automaton.hold in (last.source, last.target)
        if automaton.is_corner or rests or (automaton.has_surface and not automaton.is_unilateral):
            continue
        departure = _departure(system, outcome, c, last)
        if departure is not None and departure.unknown >= LEAST_LOSS:
            found[c] = departure
    return found


def _agreed(
    system: System, outcome: Outcome, c: int, best: _Forecast, speed: float, last: Bounce, record: Trajectory
) -> tuple[float, int]:
    """Return the earliest forecast that agrees with all later ones, and how many of them agree."""
    count = 1
    for bounce in _backward(system.automata[c], last, record):
        departure = _departure(system, outcome, c, bounce)
        if departure is None:
            break
        if departure.speed < _STRIDE * speed:
            continue
        forecast = _forecast(system, outcome, c, bounce, departure)
        if forecast is None or abs(forecast.limit - best.limit) > best.error:
            break
        best, speed, count = forecast, departure.speed, count + 1
    return best.limit, count


def _departure(system: System, outcome: Outcome, c: int, bounce: Bounce) -> _Departure | None:
    """Return the motion of the guard of the new mode that rises from zero and will fall again, or None."""
    series = _series(system, outcome, c, bounce.instant, bounce.target, bounce.x_plus)
    for guard in system.automata[c].guards[bounce.target]:
        (value, rate, curve), bound = series.guards[guard, :3].tolist(), float(series.guard_bounds[guard, 0])
        if abs(value) <= bound and curve < 0.0 < rate:
            return _Departure(rate, -rate / curve, -4.0 * (curve / rate) * (bound / rate))
    return None


def _forecast(
    system: System, outcome: Outcome, c: int, bounce: Bounce, departure: _Departure
) -> _Forecast | None:
    """Return the time at which bounces end, forecast from one bounce, or None if no speed is lost."""
    automaton = system.automata[c]
    names = automaton.guard_names[bounce.source]
    if bounce.guard not in names:
        return None
    guard = automaton.guards[bounce.source][names.index(bounce.guard)]
    series = _series(system, outcome, c, bounce.instant, bounce.source, bounce.x_minus)
    approach = -float(series.guards[guard, 1])
    if not 0.0 < departure.speed < approach:
        return None
    loss = 1.0 - departure.speed / approach
    hidden = departure.unknown / loss
    rest = departure.flight / loss
    limit = float(bounce.instant.plus(rest))
    return _Forecast(limit, rest * min(1.0, hidden) + 4.0 * UNIT * abs(limit), hidden)


def _backward(automaton: Automaton, last: Bounce, record: Trajectory) -> Iterator[Bounce]:
    """Yield the earlier bounces of a component, latest first, back to its last departure from the holding mode."""
    blocks = reversed(record.occurrences.blocks)
    events = (block[i] for block in blocks for i in range(len(block) - 1, -1, -1))
    for o in islice(events, LOOKED_BACK_ON):
        if o.component == automaton.name and o.instant != last.instant:
            bounce = _recorded(automaton, o)
            if automaton.hold in (bounce.source, bounce.target):
                return
            yield bounce


def _series(system: System, outcome: Outcome, c: int, instant: Instant, mode: int, x: np.ndarray) -> Series:
    """Return the Taylor series of all guards, with one component in the given mode."""
    z = outcome.z.copy()
    z[c] = mode
    p = system.vector(instant, system.discrete(outcome.p))
    return system.series(0.0, x, p, z, outcome.x_error + 4.0 * UNIT * np.abs(x), 0.0)
