"""This module handles runs on which a guard or surface is exactly zero until a small change makes it nonzero.

A change to the side of the run leaves the run as it is. A change to the other side is followed for the time
tau until it returns, which is of first order. The rates differ there, so that the states change by (f_there -
f_here) tau. If it does not return, or a reset acts there, the run on the other side is another one, and there
is no derivative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from hybridsim.analysis.variations.changes import Changed, Changes, Place
from hybridsim.analysis.variations.tapes import tangent_tape
from hybridsim.analysis.variations.zeros.zero_function import ZeroFunction, are_alike
from hybridsim.engine.lowering.reset_keys import added
from hybridsim.engine.series.dual_numbers import Dual, differentiated, values_and_slopes, with_slopes
from hybridsim.engine.system.system import System

_SAME = 1e-9  # of their size: rates on two sides of a guard that differ by less are equal


class OffZero(NamedTuple):
    """A function that is exactly zero at time t, and its effect on the derivatives in M directions.

    moves : mask (M,) of these directions. lost : mask (M,) of those from whose side the run does not return.
    more : addition to the derivatives (n, M) of the states on the other side; zero elsewhere.
    parts : whether a run on the other side is known to part from the run only later.
    """

    t: float
    name: str
    moves: np.ndarray
    lost: np.ndarray
    more: np.ndarray
    parts: bool = False


def rates_of(system: System, s: float, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return the rates dx/dt (n,); held states move along their constraints."""
    rates = system.flow(s, x, p, z)
    if not system.holds(z):
        return rates
    out: list[object] = [0.0] * system.n
    project = differentiated(system.code.module.project)
    project(Dual(s, np.ones(1)), with_slopes(x, rates[:, None]), [float(v) for v in p], z, out)
    return values_and_slopes(out, 1)[1][:, 0]


def differ(one: np.ndarray, other: np.ndarray) -> bool:
    """Return whether two arrays of rates (n,) differ by more than rounding."""
    return bool((np.abs(one - other) > _SAME * (np.abs(one) + np.abs(other))).any())


def off_zero(changes: Changes, at: Place) -> tuple[np.ndarray, list[OffZero], list[ZeroFunction]]:
    """Return the derivatives corrected by constraints, the functions at zero, and those of them with zero rate."""
    sides = _Sides(changes, at)
    off = sides.surfaces()
    return sides.at.Y, off + sides.guards(), sides.staying


def limits_reached(changes: Changes, at: Place, components: Sequence[int]) -> list[OffZero]:
    """Return the force limits that are reached exactly, with no margin, when a component changes its mode."""
    sides = _Sides(changes, at)
    return [one for c in components for one in sides.limits(c)]


class _Sides:
    """Computes the effects of small changes on functions that are exactly zero, on both sides of zero."""

    def __init__(self, changes: Changes, at: Place) -> None:
        self.changes, self.system, self.at, self.before = changes, changes.system, at, at
        self.pushed = np.zeros(
            at.Y.shape[1], dtype=bool
        )  # directions with impulses of components that hold again
        self.here = self._rates(at.z)
        self.staying: list[ZeroFunction] = []

    def guards(self) -> list[OffZero]:
        """Return the surfaces that are zero and have different rates on their two sides."""
        guards_here = [
            (c, i, g)
            for c, automaton in enumerate(self.system.automata)
            if not automaton.has_surface
            for i, g in enumerate(automaton.guards[self.at.z[c]])
        ]
        if not guards_here:
            return []
        numbers = tuple(g for _, _, g in guards_here)
        found, before = self.changes.of(self.at, numbers), self.changes.of(self.before, numbers)
        off = []
        for (c, i, _), one, earlier in zip(guards_here, found, before, strict=True):
            noted = self._guard(c, i, one) if one.is_zero and one.moves.any() else []
            off += noted
            if one.is_zero and one.along(self.here) == 0.0:
                self._stays(c, i, np.any([other.moves for other in noted], axis=0) | np.zeros_like(one.moves))
            if one.is_zero and (earlier.moves & self.pushed).any():  # it may fire before holding is restored
                for other in self._guard(c, i, earlier):
                    lost = (other.lost | other.more.any(axis=0)) & self.pushed
                    off.append(other._replace(lost=lost, more=np.zeros_like(other.more)))
        return off

    def surfaces(self) -> list[OffZero]:
        """Return the surfaces at zero on whose two sides the rates differ.

        A change off a held surface returns at once, by an impulse of the force that holds it.
        """
        chosen = [
            (k, c)
            for k, c in enumerate(self.system.surface_of)
            if min(self.system.automata[c].above, self.system.automata[c].below) >= 0
        ]
        if not chosen:
            return []
        free = self.at.z.copy()  # held states are replaced in formulas
        for _, c in chosen:
            free[c] = self.system.automata[c].above
        found = self.changes.of(replace(self.at, z=free), surfaces=tuple(k for k, _ in chosen))
        off: list[OffZero] = []
        rows, pushes, moved, at_limit, passed, holding, loose = (list[Any]() for _ in range(7))
        for (k, c), one in zip(chosen, found, strict=True):
            automaton = self.system.automata[c]
            above, below = (self._rates(self._with(c, mode)) for mode in (automaton.above, automaton.below))
            if self.at.z[c] != automaton.hold:
                if one.is_zero:
                    at_limit.append(c)
                    noted = one.moves & differ(above, below)
                    if differ(above, below):
                        passed.append((k, c, above, below))
                    if one.along(above) == one.along(below) == 0.0:  # else it holds, see `limits`
                        here, there = int(self.at.z[c]), automaton.above + automaton.below - int(self.at.z[c])
                        self.staying.append(ZeroFunction(automaton.name, c, here, there, noted, surface=k))
                continue
            at_limit.append(c)
            comes_back = one.row @ (above - self.here) < 0.0 < one.row @ (below - self.here)
            comes_back &= _are_opposite(above - self.here, below - self.here)
            if not comes_back:
                loose.append(c)
            if one.moves.any() and not comes_back:
                off.append(self.off(automaton.name, one, one.moves, self.here, 0.0))
            else:
                holding.append((c, one))
                rows.append(one.row)
                pushes.append(above - self.here)
                moved.append(np.where(one.moves, one.by, 0.0))
        before = self.before
        if np.any(moved):
            W, B = np.array(rows), np.array(pushes).T
            Y = before.Y - B @ np.linalg.lstsq(W @ B, np.array(moved), rcond=None)[0]
            self.at, self.pushed = replace(before, Y=Y), np.any(moved, axis=0)
            off += [
                one
                for c, held in holding
                for other in loose
                if c != other
                for one in self._freed(c, held, other)
            ]
        for k, c, above, below in passed:
            both = [self.changes.of(replace(at, z=free), surfaces=(k,))[0] for at in (before, self.at)]
            off += self._passed(c, both, above, below)
        for c in at_limit:
            off += self.limits(c)
        return off

    def _passed(self, c: int, both: list[Changed], above: np.ndarray, below: np.ndarray) -> list[OffZero]:
        """Describe how a surface that the run leaves affects the derivatives.

        On the other side, directions with impulses do not return by themselves.
        """
        pushed = self.pushed
        name, is_above = self.system.automata[c].name, bool(self.at.z[c] == self.system.automata[c].above)
        there = below if is_above else above
        off = []
        for one, mask, is_pushed in (
            (both[0], pushed, True),
            (both[1], pushed, True),
            (both[1], ~pushed, False),
        ):
            moves = one.moves & mask
            if moves.any():
                other = moves & (one.by < 0.0 if is_above else one.by > 0.0)
                speed = one.along(there)
                comes_back = not is_pushed and (speed > 0.0 if is_above else speed < 0.0)
                off.append(self.off(name, one, other, there, speed if comes_back else 0.0))
        return off

    def _freed(self, c: int, one: Changed, other: int) -> list[OffZero]:
        """Return a component that would stop holding because of the impulse of component `c`."""
        automaton, off = self.system.automata[c], []
        numbers = self.system.automata[other].guards[self.system.automata[other].hold]
        for mode, mask in ((automaton.above, one.by > 0.0), (automaton.below, one.by < 0.0)):
            found = self.changes.of(replace(self.before, z=self._with(c, mode)), numbers) if numbers else []
            if any(limit.value < 0.0 and not limit.is_zero for limit in found):
                off.append(self.off(self.system.automata[other].name, one, mask, self.here, 0.0))
        return off

    def _guard(self, c: int, i: int, one: Changed) -> list[OffZero]:
        automaton, m = self.system.automata[c], int(self.at.z[c])
        choice = self.system.choose(c, m, i, self.at.s, self.at.x, self.at.p, self.at.z)
        if choice < 0:
            return []
        name = f"guard {automaton.guard_names[m][i]} of {automaton.name}"
        z, other = self._with(c, automaton.targets[m][i][choice]), one.moves & (one.by < 0.0)
        there = self._rates(z)
        if self._resets(c, m, i, choice):
            return [self.off(name, one, other, there, 0.0)]
        numbers = automaton.guards[z[c]]
        for k, back in enumerate(self.changes.of(replace(self.at, z=z), numbers) if numbers else ()):
            onward = self.system.choose(c, int(z[c]), k, self.at.s, self.at.x, self.at.p, z)
            if onward < 0 or not back.is_zero or automaton.targets[z[c]][k][onward] != m:
                continue
            speed = back.along(there)
            if speed < 0.0 and not self._resets(c, int(z[c]), k, onward) and (back.by >= 0.0)[other].all():
                return [self.off(name, back, other, there, speed)] if differ(there, self.here) else []
            if speed == 0.0 and automaton.is_corner and not automaton.is_step:
                return []
        if not numbers and tangent_tape(self.system, z).is_same(tangent_tape(self.system, self.at.z)):
            if not are_alike(self.system, c, m, int(z[c])):
                self.staying.append(ZeroFunction(name, c, m, int(z[c]), one.moves, gone=other))
            return []
        return [self.off(name, one, other, there, 0.0)]

    def _stays(self, c: int, i: int, noted: np.ndarray) -> None:
        """Store a guard that is zero with zero rate, if a small change may fire this guard later."""
        automaton, m = self.system.automata[c], int(self.at.z[c])
        choice = self.system.choose(c, m, i, self.at.s, self.at.x, self.at.p, self.at.z)
        if choice < 0:
            return
        there = automaton.targets[m][i][choice]
        back = [
            automaton.guards[there][k]
            for k, targets in enumerate(automaton.targets[there])
            if automaton.is_corner and not automaton.is_step and m in targets
        ]
        if self._resets(c, m, i, choice) or not are_alike(self.system, c, m, there):
            name = f"guard {automaton.guard_names[m][i]} of {automaton.name}"
            number = automaton.guards[m][i]
            self.staying.append(ZeroFunction(name, c, m, there, noted, number, back[0] if back else -1))

    def limits(self, c: int) -> list[OffZero]:
        """List the force limits that a component reaches exactly, in its holding mode or just before it."""
        automaton, off = self.system.automata[c], []
        z = self._with(c, automaton.hold)
        numbers = automaton.guards[automaton.hold]
        held = self._rates(z)
        for i, one in enumerate(self.changes.of(replace(self.at, z=z), numbers) if numbers else ()):
            if not one.is_zero or not one.moves.any():
                continue
            speed = one.along(held)
            name = f"guard {automaton.guard_names[automaton.hold][i]} of {automaton.name}"
            if self.at.z[c] != automaton.hold:  # beyond its zero it holds for a while
                if speed >= 0.0 or differ(held, self.here):
                    off.append(self.off(name, one, one.moves & (one.by > 0.0), held, min(speed, 0.0)))
                continue
            slipping = (self._rates(self._with(c, mode)) for mode in (automaton.above, automaton.below))
            if not (speed > 0.0 and any(not differ(rates, held) for rates in slipping)):
                off.append(self.off(name, one, one.moves & (one.by < 0.0), held, 0.0))
        return off

    def off(self, name: str, one: Changed, other: np.ndarray, there: np.ndarray, speed: float) -> OffZero:
        """Describe how a function that is exactly zero affects the derivatives if a small change makes it nonzero."""
        other = other & one.moves
        t = self.at.origin + self.at.s
        if speed == 0.0:
            return OffZero(t, name, one.moves, other, np.zeros(self.at.Y.shape))
        away = np.where(other, -one.by / speed, 0.0)
        return OffZero(t, name, one.moves, other & False, np.outer(there - self.here, away))

    def _resets(self, c: int, m: int, i: int, choice: int) -> bool:
        key = ("choice", c, m, i, choice)
        return key in self.system.resets or added(key) in self.system.resets

    def _rates(self, z: np.ndarray) -> np.ndarray:
        return rates_of(self.system, self.at.s, self.at.x, self.at.p, z)

    def _with(self, c: int, mode: int) -> np.ndarray:
        z = self.at.z.copy()
        z[c] = mode
        return z


def _are_opposite(one: np.ndarray, other: np.ndarray) -> bool:
    lengths = np.linalg.norm(one) * np.linalg.norm(other)
    return bool(one @ other <= -(1.0 - _SAME) * lengths)


def beyond(off: Sequence[OffZero], width: int) -> tuple[np.ndarray, np.ndarray | float]:
    """Return the mask (M,) of directions without derivatives, and the sum of the contributions of all functions.

    A direction to the other side of several functions at once is lost, because the order of return matters.
    """
    lost, more, count = np.zeros(width, dtype=bool), np.zeros(1), np.zeros(width)
    for one in off:
        lost = lost | one.lost
        more = more + one.more
        count += one.more.any(axis=0)
    return lost | (count > 1), more
