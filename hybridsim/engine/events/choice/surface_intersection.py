"""Check that motion at an intersection of switching surfaces is unique and attracted to the intersection.

On k surfaces at once ds/dt = a + B u with u in [-1, 1]^k. If all principal minors of -B are positive (a P-matrix),
exactly one choice of u, among the corners, edges and the inside of that cube, is consistent for every a (Cottle, Pang
and Stone, The Linear Complementarity Problem, SIAM, 2009, doi:10.1137/1.9780898719000). On two surfaces the motion is
then attracted to the intersection: a turn around it contracts by ((B12 + B11)**2 - a1**2)/((B12 - B11)**2 - a1**2)
times the same factor of the other surface. Surfaces to which all fields point (nodal attractivity) are a special case.
On more than two surfaces the sliding motion is the selected one, though others may spiral about it. If -B is not a
P-matrix, a motion that slides along several surfaces is not unique.
"""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np

from hybridsim.engine.events.choice.event_verdicts import EventVerdicts
from hybridsim.engine.events.choice.verdict import FINE
from hybridsim.engine.events.fatal_guards import message_of_every_mode
from hybridsim.engine.series.bounded import UNIT
from hybridsim.model.meanings import Meanings

_SAME = 64.0 * UNIT  # relative difference of two series of one motion, by the rounding of a few operations


def rivals(
    resolution: EventVerdicts, members: list[int], candidates: np.ndarray, verdicts: np.ndarray
) -> np.ndarray:
    """Return the admissible candidates if they differ in a switching surface's mode and in the motion.

    Otherwise the result is empty. A relay that is just strong enough has one motion in two modes: it may slide, or be
    on the side on which nothing moves any more.
    """
    unique = [k for k, c in enumerate(members) if resolution.system.automata[c].is_unique]
    if not unique:
        return candidates[:0]
    fine = candidates[verdicts == FINE]
    if len(np.unique(fine[:, unique], axis=0)) < 2 or is_one_motion(resolution, members, fine):
        return fine[:0]
    return fine


def is_one_motion(resolution: EventVerdicts, members: list[int], candidates: np.ndarray) -> bool:
    """Return whether the motions in several combinations of modes have the same Taylor series."""
    motions = [resolution.series_of(resolution.with_modes(members, modes)).states for modes in candidates]
    if not np.isfinite(motions).all():
        return False
    sizes = np.abs(motions).max(axis=0)
    return all((np.abs(other - motions[0]) <= _SAME * sizes).all() for other in motions[1:])


def on_its_side(resolution: EventVerdicts, members: list[int], candidates: np.ndarray) -> int:
    """Return the number of the first candidate whose surfaces have the signs that its modes require, or 0.

    A body at rest may slip either way within rounding. Its holding mode leaves it a speed, or a rate, of some sign.
    """
    system, at = resolution.system, resolution.at
    for number, modes in enumerate(candidates):
        z = resolution.with_modes(members, modes)
        x = system.project(at.s, at.x, at.p, z)
        series = resolution.series_of(z, x).surfaces
        values = np.where(series[:, 0] == 0.0, series[:, 1], series[:, 0])
        sides = [
            int(z[c] == system.automata[c].above) - int(z[c] == system.automata[c].below)
            for c in system.surface_of
        ]
        if (np.sign(values) * sides >= 0.0).all():
            return number
    return 0


def keeps_nothing(resolution: EventVerdicts, members: list[int], z: np.ndarray) -> str:
    """Return the reason why a motion along several surfaces may not be unique, or an empty text if it is unique."""
    automata = resolution.system.automata
    sliding = [c for c in members if automata[c].is_unique and z[c] == automata[c].hold]
    if len(sliding) < 2:
        return ""
    pull = _pull(resolution, sliding, z)
    if not np.isfinite(pull).all():
        return ""  # no conclusion is possible; the run reports what is not a number
    # a surface whose rate no relay changes is held by the surface of its rate (hybridsim.engine.lowering.second_order)
    moved = np.flatnonzero(pull.any(axis=1))
    sliding, pull = [sliding[i] for i in moved], pull[np.ix_(moved, moved)]
    for size in range(1, len(sliding) + 1):
        for chosen in combinations(range(len(sliding)), size):
            block = pull[np.ix_(chosen, chosen)]
            largest = float(np.prod(np.abs(block).sum(axis=1)))  # upper bound of the minor
            if not np.linalg.det(block) > 8.0 * size * UNIT * largest:
                names = " and ".join(automata[sliding[i]].name for i in chosen)
                return (
                    f"the surfaces {names} do not attract the motion to their intersection: sliding is not unique"
                    if size > 1
                    else f"the surface {names} does not attract the motion while it slides along other surfaces"
                )
    return ""


def _pull(resolution: EventVerdicts, sliding: list[int], z: np.ndarray) -> np.ndarray:
    """Return a matrix (k, k): the fall of the rate of surface i if the mode of surface j goes from below to above."""
    automata, order = resolution.system.automata, resolution.system.surface_of
    rows = [order.index(c) for c in sliding]
    found = np.empty((len(sliding), len(sliding)))
    trial = z.copy()
    trial[sliding] = [automata[c].above for c in sliding]
    for j, c in enumerate(sliding):
        rates = []
        for side in (automata[c].below, automata[c].above):
            other = trial.copy()
            other[c] = side
            series: Any = resolution.series_of(other)
            rates.append(series.surfaces[rows, 1])
        with np.errstate(invalid="ignore"):  # the difference of two infinite rates
            found[:, j] = 0.5 * rates[0] - 0.5 * rates[1]  # halved first, to avoid overflow
    return found


def refused(resolution: EventVerdicts, members: list[int], message: str) -> tuple[str, str]:
    """Return the status and the message if no candidate is admissible, with hints on switching surfaces."""
    system = resolution.system
    if fatal := message_of_every_mode(system, members, resolution.sides):
        return "inconsistent", fatal
    unique = [c for c in members if system.automata[c].is_unique]
    slow = [c for c in unique if c not in system.pins and c not in system.projected]
    if slow:
        names = ", ".join(system.automata[c].name for c in slow)
        return "inconsistent", (
            f"{message}; {names} acts only on higher derivatives of its switching function; sliding of this "
            "higher order is not supported"
        )
    pull = np.diag(_pull(resolution, unique, np.maximum(resolution.at.z, 0))) if unique else np.ones(0)
    if (pull < 0.0).any():
        names = ", ".join(system.automata[c].name for c, own in zip(unique, pull, strict=True) if own < 0.0)
        return "nonunique", (
            f"{message}; {names} drives the motion away from its surface, so the motion that leaves this surface is "
            "not unique"
        )
    return "inconsistent", message


def message_on_cascade(resolution: EventVerdicts) -> str:
    """Return a hint on transitions that repeat without end, or an empty text."""
    for make_message in (
        _message_on_numbers,
        _message_on_opposed_modes,
        _message_on_negative_guard,
        _message_on_drift,
    ):
        if found := make_message(resolution):
            return found
    return ""


def _message_on_numbers(resolution: EventVerdicts) -> str:
    """Return a hint on a motion that would slide along a whole value of the argument of floor, else an empty text."""
    system = resolution.system
    negative = system.active(np.maximum(resolution.at.z, 0)) & (resolution.sides < 0)
    names = [system.automata[c].name for c in system.numbers if c in system.owner[negative]]
    if not names:
        return ""
    return (
        f". The motion leads back to the jump of {names[-1]} from both sides, and would slide along it, which is not "
        "supported: write this jump with sign(...), along whose zero a motion can slide"
    )


def _message_on_drift(resolution: EventVerdicts) -> str:
    """Return a hint if a guard is already negative when a transition leads back into its mode, else an empty text."""
    system, last = resolution.system, resolution.changes[-2:]
    if len(last) < 2 or last[0].component != last[1].component or last[0].source != last[1].target:
        return ""
    automaton = system.automata[last[0].component]
    for change in last:
        if change.guard not in automaton.guard_names[change.source]:
            continue
        number = automaton.guards[change.source][automaton.guard_names[change.source].index(change.guard)]
        z = resolution.with_modes([change.component], np.array([change.source]))
        value = float(resolution.series_of(z).guards[number, 0])
        if value < 0.0:
            return (
                f". Guard {change.guard} is {value:.6g} where a transition leads to {automaton.modes[change.source]}. "
                "If it should be zero there, integration errors have accumulated: let a reset of that transition set "
                "the states on which the guard depends, or pass a smaller rtol"
            )
    return ""


def _message_on_negative_guard(resolution: EventVerdicts) -> str:
    """Return a hint on a guard that stays negative after its transition."""
    if not resolution.changes:
        return ""
    change, system = resolution.changes[-1], resolution.system
    automaton, mode = system.automata[change.component], int(resolution.at.z[change.component])
    if change.guard not in automaton.guard_names[mode]:
        return ""
    number = automaton.guards[mode][automaton.guard_names[mode].index(change.guard)]
    value = float(resolution.series_of(np.maximum(resolution.at.z, 0)).guards[number, 0])
    if not value < 0.0:
        return ""
    return (
        f". Guard {change.guard} is {value:.6g} in {automaton.modes[mode]} before and after its transition. "
        "A guard must be positive while its mode is active: reverse its sign, or let the transition change a "
        "state that the guard depends on"
    )


def _message_on_opposed_modes(resolution: EventVerdicts) -> str:
    """Return a hint if each of two modes moves the state across one surface into the other mode."""
    model, last = resolution.system.model, resolution.changes[-2:]
    if len(last) < 2 or last[0].component != last[1].component or last[0].source != last[1].target:
        return ""
    component = model.all_components()[last[0].component]
    meanings = Meanings(model)
    guards = [
        guard
        for change in last
        for guard in component.modes[change.source].guards
        if guard.name == change.guard
    ]
    if component.surface or len(guards) != 2:
        return ""
    (one, sign), (other, opposite) = (meanings.family(guard.expr.tree) for guard in guards)
    if one != other or sign != -opposite:
        return ""
    names = " and ".join(component.modes[change.source].name for change in last)
    return (
        f". Modes {names} move the state across the same surface, each into the other mode. "
        "If the motion should slide along this surface, declare a switching surface: [surfaces.NAME] expr = "
        f'"{guards[0].expr.text}" (NAME is +1 or -1 on its sides)'
    )
