"""Where events accumulate: from there on the motion slides along their surfaces, rests in contacts, or as declared."""

from __future__ import annotations

import numpy as np

from hybridsim.engine.jets import UNIT
from hybridsim.engine.outcome import Change, Outcome, Situation
from hybridsim.engine.settle import Settling
from hybridsim.engine.system import Series, System

LIMIT = "limit"  # as the guard of the changes that are made where events accumulate
_REACH = (
    2.0  # a surface this many times as far away as it may move in the time that is left is not the limit's
)


def gathered(system: System, outcome: Outcome, p: np.ndarray, s: float, left: float) -> Outcome | None:
    """What holds at the limit, at local time s, of crossings or impacts; None if it is none of what can be held.

    It is of the surfaces that their rates and these rates' own may bring to zero within the time `left`, and of the
    contacts whose gaps and their rates come to zero in it. The state is put onto them, by less than the motion moves
    meanwhile; the decision is that of any event (`hybridsim.engine.settle`).
    """
    near = _within_reach(system, outcome, p, left)
    if len(near) < (1 if any(system.is_unilateral[near]) else 2):
        return None
    z = outcome.z.copy()
    z[near] = [system.automata[c].hold for c in near]
    x = system.project(s, outcome.x + s * system.flow(0.0, outcome.x, p, outcome.z), p, z)
    z[near] = -1  # no mode yet: the decision takes them as they are at a start
    at = Situation(s, x, p, z, outcome.x_error.copy(), 0.0)
    found = Settling(system, at, outcome.z.copy(), forward=True).run((), [])
    if found.status or any(
        found.z[c] != system.automata[c].hold for c in near if not system.is_unilateral[c]
    ):
        return None
    found.changes = [
        Change(c, LIMIT, int(outcome.z[c]), int(found.z[c]), outcome.x, found.x) for c in near
    ] + found.changes
    found.continuous = False
    return found


def at_declared_limit(
    system: System, outcome: Outcome, p: np.ndarray, s: float, changed: list[int]
) -> Outcome | None:
    """What holds at the limit, at local time s, of transitions of these components; None where none says what."""
    entered = [c for c in changed if system.automata[c].limit >= 0]
    if not entered:
        return None
    z = outcome.z.copy()
    z[entered] = [system.automata[c].limit for c in entered]
    x = outcome.x + s * system.flow(0.0, outcome.x, p, outcome.z)
    at = Situation(s, x.copy(), p.copy(), z, outcome.x_error.copy(), 0.0)
    found = Settling(system, at, outcome.z.copy(), forward=True).run((), [("limit", c) for c in entered])
    found.changes = [
        Change(c, LIMIT, int(outcome.z[c]), system.automata[c].limit, x, found.x) for c in entered
    ] + found.changes
    found.continuous = False
    return found


def holds_several(system: System, outcome: Outcome) -> bool:
    """Whether an event ends with several switching surfaces held that were not held before it."""
    changed = [(system.automata[c.component], c.target) for c in outcome.changes]
    return sum(automaton.is_unique and target == automaton.hold for automaton, target in changed) > 1


def hidden_flight(system: System, outcome: Outcome, p: np.ndarray) -> float | None:
    """How long a contact that has just bounced stays open, if so low that rounding hides its gap; else None.

    Impacts that follow are not to be told from rest: no gap can be found to close that was never seen to open. With
    little restitution that comes before there are enough of them to be recognised as a series.
    """
    automata = system.automata
    bounced = {
        c.component
        for c in outcome.changes
        if automata[c.component].is_unilateral and automata[c.component].hold not in (c.source, c.target)
    }
    if not bounced:
        return None
    errors = outcome.x_error + 4.0 * UNIT * np.abs(outcome.x)
    series = system.series(0.0, outcome.x, p, outcome.z, errors, 0.0)
    assert isinstance(series, Series)  # models with impacts are made from expressions
    flights = []
    for k, c in enumerate(system.surface_of):
        if c in bounced:
            (_, rate, curve), bound = series.surfaces[k, :3], series.surface_bounds[k, 0]
            if (
                curve < 0.0 < rate and rate**2 <= -4.0 * curve * bound
            ):  # the square is 4 |curve| times the height
                flights.append(-rate / curve)
    return max(flights, default=None)


@np.errstate(over="ignore")  # what is too large to tell is within reach
def _within_reach(system: System, outcome: Outcome, p: np.ndarray, left: float) -> list[int]:
    series = system.series(0.0, outcome.x, p, outcome.z, outcome.x_error, 0.0)
    found = []
    for k, c in enumerate(system.surface_of):
        automaton = system.automata[c]
        if not (automaton.is_unique or automaton.is_unilateral) or outcome.z[c] == automaton.hold:
            continue
        (value, rate, curve), bounds = series.surfaces[k, :3], series.surface_bounds[k, :3]
        is_near = abs(value) <= _REACH * (abs(rate) + abs(curve) * left) * left + bounds[0]
        if automaton.is_unilateral:
            is_near = is_near and abs(rate) <= 2.0 * _REACH * abs(curve) * left + bounds[1]
        if is_near:
            found.append(c)
    return found
