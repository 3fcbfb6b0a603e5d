"""This module describes an impact in words: restitution, speeds, and friction."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from hybridsim.engine.events.outcome import Change
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.system import System
from hybridsim.model import Model
from hybridsim.model.parts.impact import SPEED
from hybridsim.model.smoothing.one_sided import number_of
from hybridsim.solution.explain.candidate import GuardView, views
from hybridsim.solution.explain.stages import Stage

_AT_LIMIT = 1e-9  # relative distance of an impulse to its limit; a closer impulse counts as at the limit


def restitution(model: Model, stage: Stage, c: int, impact_guard: GuardView) -> str:
    """Describe the restitution of an impact, with the speeds at which the gap closed and opens."""
    resolution, outcome = stage.resolution, stage.outcome
    system, automaton = resolution.system, resolution.system.automata[c]
    declared = next(i for i in model.impacts if i.name == automaton.name).restitution
    z = outcome.z.copy()
    z[c] = 1 - automaton.hold  # open mode; the only one with the gap as its guard
    guard = automaton.guards[z[c]][0]
    at = replace(resolution.at, x=outcome.x)
    (after,) = views(system, at, z, [guard], np.zeros(system.guard_count, int))
    before, unit = -impact_guard.derivatives[1], impact_guard.units[1]
    known = model.parameter_values() | {SPEED: before}
    value = number_of(declared.tree, known, {n: expr.tree for n, expr in model.definitions}.get)
    e = declared.text if value is None or not declared.names else f"{declared.text} = {value:.6g}"
    speeds = [f"{max(speed, 0.0):.6g} {unit}".rstrip() for speed in (before, after.derivatives[1])]
    return f" with restitution {e}, the gap closing at {speeds[0]} and opening at {speeds[1]}"


def is_struck(system: System, change: Change) -> bool:
    """Return whether a change of mode belongs to a contact whose gap closes by an impact."""
    automaton = system.automata[change.component]
    return change.guard == "gap" and automaton.is_unilateral and change.source != automaton.hold


def errors_beside(stage: Stage, c: int) -> np.ndarray:
    """Return bounds on the rounding errors of the states that an impulse of a contact can change."""
    system, at = stage.resolution.system, stage.before
    cluster = next(cluster for cluster in system.clusters if c in cluster)
    _, changes, _ = system.impulses(at.s, at.x, at.p, np.maximum(at.z, 0))
    can_change = changes[[system.surface_of.index(k) for k in cluster]].any(axis=0)
    return np.where(can_change, at.x_error, np.inf)


def friction(stage: Stage, c: int) -> str:
    """Describe the friction during an impact (slip or stick), or return an empty text.

    The impulses are computed from the changes of the states. The text is empty if several sets of impulses
    fit.
    """
    system, at, z = stage.resolution.system, stage.before, np.maximum(stage.before.z, 0)
    if stage.due or any((one.x_minus != one.x_plus).any() for one in stage.resolution.changes):
        return ""  # resets changed the states as well
    cluster = next(cluster for cluster in system.clusters if c in cluster)
    place = {k: i for i, k in enumerate(system.surface_of)}
    slopes, changes, loads = system.impulses(at.s, at.x, at.p, z)
    free = at.p.copy()
    free[system.layout.pin_at] = 0.0
    series: Any = system.series(at.s, at.x, free, z, at.x_error, at.s_error)
    gaps = series.surfaces[:, 0], series.surface_bounds[:, 0]
    normal = [
        k
        for k in cluster
        if system.is_unilateral[k] and (k == c or abs(gaps[0][place[k]]) <= gaps[1][place[k]])
    ]
    columns = [place[k] for k in normal]
    rubbing = [k for k in cluster if not system.is_unilateral[k] and loads[:, place[k]][:, columns].any()]
    rows = [place[k] for k in (*normal, *rubbing)]
    moved = stage.outcome.x - at.x
    moved[np.abs(moved) <= 2.0 * at.x_error] = 0.0
    if not rubbing or np.linalg.matrix_rank(changes[rows]) < len(rows):
        return ""
    inverse = np.linalg.pinv(changes[rows].T)
    impulses = inverse @ moved
    # This bounds the effect of the states' rounding on an impulse.
    errors = np.abs(inverse) @ (4.0 * at.x_error + 8.0 * UNIT * np.abs(at.x))
    pushes = impulses[: len(normal)]
    clauses = []
    for k, impulse, error in zip(rubbing, impulses[len(normal) :], errors[len(normal) :], strict=True):
        before, after = series.surfaces[place[k], 0], series.surfaces[place[k], 0] + slopes[place[k]] @ moved
        rest = 8.0 * (series.surface_bounds[place[k], 0] + np.abs(slopes[place[k]]) @ at.x_error)
        is_back = after < -rest or (abs(after) <= rest and impulse < 0.0)
        shares = loads[1 if is_back else 0, place[k]][columns]
        limit = float(shares @ pushes)
        terms = zip(shares.tolist(), pushes.tolist(), strict=True)
        bound = " + ".join(f"{share:.6g}*{push:.6g}" for share, push in terms if share)
        size = f"{abs(impulse):.6g}"
        name = system.automata[k].name
        if not bound:
            continue
        if (
            abs(after) > rest
            and abs(abs(impulse) - limit) <= _AT_LIMIT * limit + error + shares @ errors[: len(normal)]
        ):
            clauses.append(f"the impulse of {name} is at its limit, {bound} = {limit:.6g}")
        elif abs(after) > rest:
            clauses.append(f"the impulse of {name} is {size}, at most {bound} = {limit:.6g}")
        else:
            does = "stops it" if abs(before) > rest else "keeps it at rest"
            is_all = abs(abs(impulse) - limit) <= _AT_LIMIT * limit
            where = "just at" if is_all and limit else "within"
            clauses.append(f"the impulse of {name}, {size}, {does} {where} its limit {bound} = {limit:.6g}")
    return f"; {' and '.join(clauses)}" if clauses else ""
