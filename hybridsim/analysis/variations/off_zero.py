"""States exactly on a guard or surface that a change moves off it: what friction makes of that, or no derivative."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hybridsim.analysis.variations.changes import Changes, Place
from hybridsim.engine.dual_numbers import Dual, differentiated, values_and_slopes, with_slopes
from hybridsim.engine.reset_keys import added
from hybridsim.engine.system import System

_SAME = 1e-9  # of their size: rates on two sides of a guard that differ by less are the same


class OffZero(NamedTuple):
    """What is at its zero at time t, and a mask (M,) of the directions that move it off to either side."""

    t: float
    name: str
    directions: np.ndarray


def rates_of(system: System, s: float, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> np.ndarray:
    """dx/dt (n,) as the states move: those that a mode holds go with their constraint, which no flow says."""
    rates = system.flow(s, x, p, z)
    if not system.holds(z):
        return rates
    out: list[object] = [0.0] * system.n
    project = differentiated(system.code.module.project)
    project(Dual(s, np.ones(1)), with_slopes(x, rates[:, None]), [float(v) for v in p], z, out)
    return values_and_slopes(out, 1)[1][:, 0]


def differ(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether rates (n,) are not the same."""
    return bool((np.abs(one - other) > _SAME * (np.abs(one) + np.abs(other))).any())


def guards_at_zero(changes: Changes, at: Place) -> list[OffZero]:
    """Guards that are at their zero without firing, and would on one side only, with an effect."""
    system = changes.system
    places = [
        (c, i, g)
        for c, automaton in enumerate(system.automata)
        if not automaton.has_surface
        for i, g in enumerate(automaton.guards[at.z[c]])
    ]
    if not places:
        return []
    found, here = changes.of(at, tuple(g for _, _, g in places)), rates_of(system, at.s, at.x, at.p, at.z)
    off = []
    for (c, i, _), one in zip(places, found, strict=True):
        if not one.is_zero or not one.moves.any():
            continue
        automaton, m = system.automata[c], int(at.z[c])
        choice = system.choose(c, m, i, at.s, at.x, at.p, at.z)
        if choice < 0:
            continue
        key = ("choice", c, m, i, choice)
        z = at.z.copy()
        z[c] = automaton.targets[m][i][choice]
        resets = key in system.resets or added(key) in system.resets
        if resets or one.is_tangential or differ(here, rates_of(system, at.s, at.x, at.p, z)):
            name = f"guard {automaton.guard_names[m][i]} of {automaton.name}"
            off.append(OffZero(at.origin + at.s, name, one.moves))
    return off


def surfaces_at_zero(changes: Changes, at: Place) -> tuple[np.ndarray, list[OffZero]]:
    """Derivatives (n, M) of the states when all that hold do so again, and surfaces from which the sides differ.

    What moves off a surface that holds it comes back at once, by an impulse of the force that drives it there.
    """
    system = changes.system
    chosen = [
        (k, c)
        for k, c in enumerate(system.surface_of)
        if min(system.automata[c].above, system.automata[c].below) >= 0
    ]
    Y, off = at.Y, list[OffZero]()
    if not chosen:
        return Y, off
    free = at.z.copy()  # what holds a state replaces it in formulas
    for _, c in chosen:
        free[c] = system.automata[c].above
    found = changes.of(replace(at, z=free), surfaces=tuple(k for k, _ in chosen))
    here = rates_of(system, at.s, at.x, at.p, at.z)
    rows, pushes, moved = [], [], []
    for (_, c), one in zip(chosen, found, strict=True):
        automaton = system.automata[c]
        holds = at.z[c] == automaton.hold
        sides = []
        for mode in (automaton.above, automaton.below):
            z = at.z.copy()
            z[c] = mode
            sides.append(rates_of(system, at.s, at.x, at.p, z))
        comes_back = one.row @ (sides[0] - here) < 0.0 < one.row @ (sides[1] - here)
        if one.moves.any() and (not comes_back if holds else one.is_zero and differ(*sides)):
            off.append(OffZero(at.origin + at.s, automaton.name, one.moves))
        elif holds:
            rows.append(one.row)
            pushes.append(sides[0] - here)
            moved.append(np.where(one.moves, one.by, 0.0))
    if np.any(moved):
        W, B = np.array(rows), np.array(pushes).T
        Y = Y - B @ np.linalg.lstsq(W @ B, np.array(moved), rcond=None)[0]
    return Y, off


def off_zero(changes: Changes, at: Place) -> tuple[np.ndarray, list[OffZero]]:
    """Both, the guards as they are behind the impulses."""
    Y, off = surfaces_at_zero(changes, at)
    return Y, off + guards_at_zero(changes, replace(at, Y=Y))
