"""Where events accumulate: from there on the motion slides along their surfaces, rests in contacts, or as declared."""

from __future__ import annotations

import numpy as np

from hybridsim.engine.accumulation import Limit
from hybridsim.engine.outcome import Change, Outcome, Situation
from hybridsim.engine.rest_impulses import loading, stopped
from hybridsim.engine.settle import Settling
from hybridsim.engine.system import System

LIMIT = "limit"  # as the guard of the changes that are made where events accumulate
_REACH = (
    2.0  # a surface this many times as far away as it may move in the time that is left is not the limit's
)


def behind(
    limit: Limit, system: System, outcome: Outcome, p: np.ndarray, s: float
) -> tuple[float, Outcome] | None:
    """What holds from a limit at local time s on: along surfaces, in contacts, or as declared; None if nothing.

    With the local time from which it holds: now, where something else comes before the limit.
    """
    found = _gathered(system, outcome, p, s, s + limit.passed)
    return found if found is not None else _at_declared_limit(system, outcome, p, s, limit.components)


def _gathered(
    system: System, outcome: Outcome, p: np.ndarray, s: float, left: float
) -> tuple[float, Outcome] | None:
    """At the limit of crossings or impacts; None if it is none of what can be held.

    It is of the surfaces that their rates and these rates' own may bring to zero within the time `left`, and of the
    contacts whose gaps and their rates come to zero in it. They are held from here on: on the average, bounces that
    follow each other ever faster carry the load that a closed contact carries, and crossings to and fro slide. The
    decision is that of any event (`hybridsim.engine.settle`).
    """
    near = _within_reach(system, outcome, p, left)
    if len(near) < (1 if any(system.is_unilateral[near]) else 2):
        return None
    z = outcome.z.copy()
    z[near] = [system.automata[c].hold for c in near]
    start = system.project(0.0, _without_bounces(system, outcome, p, near), p, z)
    x = _moved(system, start, p, z, s)
    if _passed_by(system, outcome, p, s, tuple(near), x):
        s, x = 0.0, start
    found = _held_at(system, outcome, p, s, near, x, z)
    return None if found is None else (s, found)


def _without_bounces(system: System, outcome: Outcome, p: np.ndarray, near: list[int]) -> np.ndarray:
    """The state after impulses that end the motion of these contacts, and leave those that are closed so."""
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
    return stopped(
        outcome.x, np.array(moving), slopes[ends], loading(changes, loads, np.array(sliding))[ends]
    )


def _moved(system: System, x: np.ndarray, p: np.ndarray, z: np.ndarray, s: float) -> np.ndarray:
    """The state at local time s from x, in one step of the classical Runge-Kutta method: s is short."""
    a = system.flow(0.0, x, p, z)
    b = system.flow(0.5 * s, x + 0.5 * s * a, p, z)
    c = system.flow(0.5 * s, x + 0.5 * s * b, p, z)
    d = system.flow(s, x + s * c, p, z)
    return system.project(s, x + s / 6.0 * (a + 2.0 * b + 2.0 * c + d), p, z)


def _held_at(
    system: System, outcome: Outcome, p: np.ndarray, s: float, near: list[int], x: np.ndarray, z: np.ndarray
) -> Outcome | None:
    """What is decided at local time s, where x is on these surfaces; None unless switching surfaces stay held."""
    if not np.isfinite(x).all():
        return None
    z = z.copy()
    z[near] = -1  # no mode yet: the decision takes them as they are at a start
    at = Situation(s, x, p, z, outcome.x_error.copy(), 0.0)
    found = Settling(system, at, outcome.z.copy(), forward=True).run((), [])
    if found.status or any(
        found.z[c] != system.automata[c].hold for c in near if system.automata[c].is_unique
    ):
        return None
    found.changes = [
        Change(c, LIMIT, int(outcome.z[c]), int(found.z[c]), outcome.x, found.x) for c in near
    ] + found.changes
    found.continuous = False
    return found


def _passed_by(
    system: System, outcome: Outcome, p: np.ndarray, s: float, apart: tuple[int, ...], x: np.ndarray
) -> bool:
    """Whether a guard of another component would have fired on the way to the limit, where the state is x."""
    z = outcome.z
    others = system.active(z) & ~np.isin(system.owner, apart)
    values = system.rows("guards", system.guard_count, np.array([s]), x[None], p, z)[0]
    return bool((values[others & (outcome.sides > 0)] < 0.0).any())


def _at_declared_limit(
    system: System, outcome: Outcome, p: np.ndarray, s: float, changed: tuple[int, ...]
) -> tuple[float, Outcome] | None:
    """At the limit of transitions of these components; None where none says what holds there."""
    entered = tuple(c for c in changed if c >= 0 and system.automata[c].limit >= 0)
    if not entered:
        return None
    z = outcome.z.copy()
    z[list(entered)] = [system.automata[c].limit for c in entered]
    x = _moved(system, outcome.x, p, outcome.z, s)
    if not np.isfinite(x).all() or _passed_by(system, outcome, p, s, entered, x):
        s, x = 0.0, outcome.x
    at = Situation(s, x.copy(), p.copy(), z, outcome.x_error.copy(), 0.0)
    found = Settling(system, at, outcome.z.copy(), forward=True).run((), [("limit", c) for c in entered])
    found.changes = [
        Change(c, LIMIT, int(outcome.z[c]), system.automata[c].limit, x, found.x) for c in entered
    ] + found.changes
    found.continuous = False
    return s, found


def closed_now(system: System, outcome: Outcome) -> tuple[int, ...]:
    """The contacts that an event has closed."""
    automata = system.automata
    return tuple(
        c.component
        for c in outcome.changes
        if automata[c.component].is_unilateral and c.target == automata[c.component].hold
    )


def holds_several(system: System, outcome: Outcome) -> bool:
    """Whether an event ends with several switching surfaces held that were not held before it."""
    changed = [(system.automata[c.component], c.target) for c in outcome.changes]
    return sum(automaton.is_unique and target == automaton.hold for automaton, target in changed) > 1


@np.errstate(over="ignore")  # what is too large to tell is within reach
def _within_reach(system: System, outcome: Outcome, p: np.ndarray, left: float) -> list[int]:
    """The contacts and surfaces that come to zero in this time; friction only with a contact, which may load it."""
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
            (found if automaton.is_unilateral or automaton.is_unique else rubbing).append(c)
    return found + rubbing if any(system.is_unilateral[found]) else found
