"""Continue from the limit of accumulating events: slide along surfaces, rest in contacts, or take the declared mode."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from hybridsim.engine.events.jumps.rest_impulses import loaded, stopped
from hybridsim.engine.events.outcome import Change, Outcome, Situation
from hybridsim.engine.events.resolve import EventResolution
from hybridsim.engine.events.zeno.accumulation import NOBODY, Limit
from hybridsim.engine.system.system import System

LIMIT = "limit"  # guard name of the changes at a limit of events
_SURE = 2.0**-46  # required relative accuracy of the state at the limit
_REACH = 2.0  # a surface farther away than this many times its possible motion is not part of the limit


def behind(
    limit: Limit, system: System, outcome: Outcome, p: np.ndarray, s: float
) -> tuple[float, Outcome] | None:
    """Return the motion that continues after infinitely many events at local time `s`, or None.

    The first item is the local time from which it holds. That is the present time if another event may come before the
    limit.
    """
    found = _gathered(system, outcome, p, s, s + limit.passed, limit.components)
    return found if found is not None else _at_declared_limit(system, outcome, p, s, limit.components)


def _gathered(
    system: System, outcome: Outcome, p: np.ndarray, s: float, left: float, changed: tuple[int, ...]
) -> tuple[float, Outcome] | None:
    """Return the state that holds surfaces and contacts at a limit of events, or None if there is none.

    The limit is on the surfaces whose rates, or derivatives of rates, may bring them to zero within the time `left`,
    and in the contacts whose gaps and rates become zero in it. They are held from here on. On average, bounces that
    follow each other ever faster carry the load of a closed contact, and alternating crossings slide. Friction that
    changed and has come to rest within rounding is held as well. `hybridsim.engine.events.resolve` decides, as at any
    event.
    """
    near = _within_reach(system, outcome, p, left, changed)
    if len(near) < (2 if all(system.automata[c].is_unique for c in near) else 1):
        return None
    z = outcome.z.copy()
    z[near] = [system.automata[c].hold for c in near]
    start = system.project(0.0, _without_bounces(system, outcome, p, near), p, z)
    x = _at_the_end(system, start, p, z, s, near)
    if x is None:
        s, x = 0.0, start
    found = _held_at(system, outcome, p, s, near, x, z)
    return None if found is None else (s, found)


def _without_bounces(system: System, outcome: Outcome, p: np.ndarray, near: list[int]) -> np.ndarray:
    """Return the state after impulses that stop some contacts and let no closed contact open."""
    automata, modes, of = system.automata, outcome.z, system.surface_of
    if not system.is_unilateral[near].any():
        return outcome.x
    series = system.series(0.0, outcome.x, p, modes, outcome.x_error, 0.0)
    slopes, changes, loads = system.impulses(0.0, outcome.x, p, modes)
    sliding = [
        0
        if system.is_unilateral[c]
        else int(modes[c] == automata[c].above) - int(modes[c] == automata[c].below)
        for c in of
    ]
    ends = [
        k
        for k, c in enumerate(of)
        if (system.is_unilateral[c] or loads[:, k].any()) and (c in near or modes[c] == automata[c].hold)
    ]
    moving = [
        series.surfaces[k, 1 if system.is_unilateral[of[k]] else 0] if of[k] in near else 0.0 for k in ends
    ]
    return stopped(outcome.x, np.array(moving), slopes[ends], loaded(changes, loads, np.array(sliding))[ends])


def _moved(system: System, x: np.ndarray, p: np.ndarray, z: np.ndarray, s0: float, s: float) -> np.ndarray:
    """Return the state at local time `s` from `x` at `s0`, by one classical Runge-Kutta step."""
    h, middle = s - s0, 0.5 * (s0 + s)
    a = system.flow(s0, x, p, z)
    b = system.flow(middle, x + 0.5 * h * a, p, z)
    c = system.flow(middle, x + 0.5 * h * b, p, z)
    d = system.flow(s, x + h * c, p, z)
    return system.project(s, x + h / 6.0 * (a + 2.0 * b + 2.0 * c + d), p, z)


def _held_at(
    system: System, outcome: Outcome, p: np.ndarray, s: float, near: list[int], x: np.ndarray, z: np.ndarray
) -> Outcome | None:
    """Return the state at local time `s` with nearby surfaces at zero, or None if there is no such state."""
    if not np.isfinite(x).all():
        return None
    z = z.copy()
    z[near] = -1  # no mode yet, as at a start
    at = Situation(s, x, p, z, outcome.x_error.copy(), 0.0)
    found = EventResolution(system, at, outcome.z.copy(), forward=True).run((), [])
    if found.status or any(
        found.z[c] != system.automata[c].hold for c in near if system.automata[c].is_unique
    ):
        return None
    found.changes = [
        Change(c, LIMIT, int(outcome.z[c]), int(found.z[c]), outcome.x, found.x) for c in near
    ] + found.changes
    found.continuous = False
    return found


def _at_the_end(
    system: System, start: np.ndarray, p: np.ndarray, z: np.ndarray, s: float, apart: Collection[int]
) -> np.ndarray | None:
    """Return the state at local time `s`, or None if the state is inaccurate or another event may come first."""
    with np.errstate(over="ignore", invalid="ignore"):
        whole = _moved(system, start, p, z, 0.0, s)
        halves = _moved(system, _moved(system, start, p, z, 0.0, 0.5 * s), p, z, 0.5 * s, s)
        if not (np.abs(whole - halves) <= _SURE * (np.abs(start) + np.abs(halves))).all():
            return None
        series = system.series(0.0, start, p, z, np.zeros(system.n), 0.0)
        held = [system.automata[c].hold for c in system.surface_of]
        guards = series.guards[system.active(z) & ~np.isin(system.owner, list(apart))]
        free = [k for k, c in enumerate(system.surface_of) if c not in apart and z[c] != held[k]]
        values = np.concatenate([guards, series.surfaces[free]])
        away = np.abs(values[:, 0]) > _REACH * np.abs(values[:, 1:]) @ s ** np.arange(1.0, values.shape[1])
    return halves if away.all() else None


def _at_declared_limit(
    system: System, outcome: Outcome, p: np.ndarray, s: float, changed: tuple[int, ...]
) -> tuple[float, Outcome] | None:
    """Return the state in the declared limit modes of some components, or None if no mode is declared."""
    entered = tuple(c for c in changed if c >= 0 and system.automata[c].limit >= 0)
    if not entered:
        return None
    z = outcome.z.copy()
    z[list(entered)] = [system.automata[c].limit for c in entered]
    x = _at_the_end(system, outcome.x, p, outcome.z, s, entered)
    if x is None:
        s, x = 0.0, outcome.x
    at = Situation(s, x.copy(), p.copy(), z, outcome.x_error.copy(), 0.0)
    found = EventResolution(system, at, outcome.z.copy(), forward=True).run(
        (), [("limit", c) for c in entered]
    )
    found.changes = [
        Change(c, LIMIT, int(outcome.z[c]), system.automata[c].limit, x, found.x) for c in entered
    ] + found.changes
    found.continuous = False
    return s, found


def counted_components(
    system: System, outcome: Outcome, fired: Collection[int]
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return the contacts that an event has closed, and the components whose events may accumulate.

    Events of continuous corners and of whole numbers do not count, because the motion goes on after them.
    """
    automata = system.automata
    closed = tuple(
        c.component
        for c in outcome.changes
        if automata[c.component].is_unilateral and c.target == automata[c.component].hold
    )
    changed = {c.component for c in outcome.changes}.difference(closed)
    if closed and not changed:
        return closed, ()
    changed = changed or {int(system.owner[g]) for g in fired} or {NOBODY}
    return closed, tuple(sorted(c for c in changed if c == NOBODY or system.may_accumulate[c]))


def holds_several(system: System, outcome: Outcome) -> bool:
    """Return whether several switching surfaces that were free before an event are held after the event."""
    changed = [(system.automata[c.component], c.target) for c in outcome.changes]
    return sum(automaton.is_unique and target == automaton.hold for automaton, target in changed) > 1


@np.errstate(over="ignore")  # overflow counts as within reach
def _within_reach(
    system: System, outcome: Outcome, p: np.ndarray, left: float, changed: tuple[int, ...]
) -> list[int]:
    """Return the components whose surfaces may be zero within a time, and friction contacts on which these act."""
    series = system.series(0.0, outcome.x, p, outcome.z, outcome.x_error, 0.0)
    found: list[int] = []
    rubbing: list[int] = []
    for k, c in enumerate(system.surface_of):
        automaton = system.automata[c]
        if outcome.z[c] == automaton.hold:
            continue
        (value, rate, curve), bounds = series.surfaces[k, :3], series.surface_bounds[k, :3]
        is_near = abs(value) <= _REACH * (abs(rate) + abs(curve) * left) * left + bounds[0]
        if automaton.is_unilateral:
            is_near = is_near and abs(rate) <= 2.0 * _REACH * abs(curve) * left + bounds[1]
        if is_near:
            (found if automaton.is_unilateral or automaton.is_unique else rubbing).append(k)
    acting = [k for k in found if system.is_unilateral[system.surface_of[k]]]
    if acting and rubbing:
        slopes, changes, loads = system.impulses(0.0, outcome.x, p, outcome.z)
        moved = slopes @ changes[acting].T
        found += [k for k in rubbing if moved[k].any() or loads[:, k, acting].any()]
    found += [k for k in rubbing if k not in found and system.surface_of[k] in changed]
    return [system.surface_of[k] for k in found]
