"""This module applies the resets of one instant to the states and their derivatives, round by round."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hybridsim.analysis.variations.changes import Changes, Place
from hybridsim.analysis.variations.impacts import Impacts
from hybridsim.analysis.variations.off_zero import OffZero, off_zero, rates_of
from hybridsim.analysis.variations.zeros.reset_corners import ResetCorners
from hybridsim.engine.events.zeno.limits import LIMIT
from hybridsim.engine.lowering.reset_keys import added
from hybridsim.engine.record.segments import Occurrence, Segment
from hybridsim.engine.series.dual_numbers import Dual, differentiated, values_and_slopes, with_slopes
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System

_ALIKE = 1e-7  # relative; guards fire together if their delays agree


def is_knot(system: System, instant: Instant) -> bool:
    """Return whether an input has a knot at an instant, within rounding."""
    slack = 4.0 * math.ulp(float(instant))
    for signal in system.signals:
        knot = signal.next_knot(instant.plus(-slack), True)
        if knot is not None and abs(knot.minus(instant)) <= slack:
            return True
    return False


def batches(happened: Sequence[Occurrence]) -> list[list[Occurrence]]:
    """Group the events of one instant; a new group begins where the recorded states differ."""
    found: list[list[Occurrence]] = []
    for one in happened:
        if (
            found
            and (one.x_minus == found[-1][0].x_minus).all()
            and (one.x_plus == found[-1][0].x_plus).all()
        ):
            found[-1].append(one)
        else:
            found.append([one])
    return found


class Rounds:
    """States, discrete states and modes at one instant, with their derivatives in M directions.

    Parameters
    ----------
    x, d, z : values (n,), (d,) and modes before.
    Y, Yd : derivatives (n, M), (d, M).
    changes : of guards and monitors, with the derivatives of the parameters.
    shift : derivatives (M,) of the time of the instant.
    large : sizes (n, M) of the terms of the sums Y.
    loose : components that hold from this instant on, each with a free mode, in which states are evaluated.
    is_start : whether the fired functions were at zero before any motion.
    sided : whether directions that move off a zero are followed on their own side.
    """

    def __init__(
        self,
        system: System,
        x: np.ndarray,
        d: np.ndarray,
        z: np.ndarray,
        Y: np.ndarray,
        Yd: np.ndarray,
        changes: Changes,
        shift: np.ndarray,
        large: np.ndarray,
        loose: Sequence[tuple[int, int]],
        is_start: bool,
        sided: bool,
    ) -> None:
        self.system, self.x, self.d, self.z, self.Y, self.Yd = system, x.copy(), d.copy(), z.copy(), Y, Yd
        self._changes, self.shift, self.large, self._sided = changes, shift, large, sided
        self._G, self._vector = changes.G, changes.vector
        self._loose, self._has_moved = loose, is_start
        self.has_reset = self.has_jumped = False
        self.off: list[OffZero] = []
        self.overtaken: list[OffZero] = []  # other events, if a change delays a round
        self._later: list[np.ndarray] = []
        self._reset = differentiated(system.code.module.reset)
        self._impacts = Impacts(system) if system.is_unilateral.any() else None
        self._corners = ResetCorners(system, self._reset, changes.own)
        self._names = [*system.names, *(v.name for v in system.model.discrete)]

    def run(self, segment: Segment, following: Instant, happened: Sequence[Occurrence]) -> None:
        """Apply the resets of the events at the end of a segment; the next segment starts at the time `following`."""
        groups = batches(happened)
        for k, batch in enumerate(groups):
            is_due = (
                any(one.kind == "scheduled" for one in batch)
                or batch[0].instant.minus(segment.end) > 0.0  # the limit of a series
                or (k == len(groups) - 1 and is_knot(self.system, following))
            )
            if is_due:
                self.at_appointment(following, batch)
            else:
                self._run(batch, segment.p, float(segment.s[-1]), float(segment.origin))

    def at_appointment(self, instant: Instant, happened: Sequence[Occurrence]) -> None:
        """Apply the resets of scheduled events, with the values that inputs have just after this instant."""
        self._run(happened, self.system.vector(instant, self.d), 0.0, float(instant))

    def _run(self, happened: Sequence[Occurrence], p: np.ndarray, s: float, origin: float) -> None:
        scheduled = [one for one in happened if one.kind == "scheduled"]
        pending = [one for one in happened if one.kind != "scheduled" and not is_recorded(self.system, one)]
        self.x = happened[0].x_minus.copy()
        if scheduled:
            self._apply(scheduled, p, s, origin)
        while pending:
            self._later = []
            fired = [one for one in pending if self._has_fired(one, p, s, origin)]
            fired = fired or pending
            if self._sided and self._later:
                self._delay(p, s, origin, fired)
            self._apply(fired, p, s, origin)
            pending = [one for one in pending if not any(one is other for other in fired)]

    def _has_fired(self, one: Occurrence, p: np.ndarray, s: float, origin: float) -> bool:
        """Return whether a guard or monitor is at or below zero, so that it has fired."""
        system = self.system
        if one.kind == "monitor":
            chosen: tuple[tuple[int, ...], tuple[int, ...]] = (
                (),
                (system.monitor_names.index(one.component),),
            )
        else:
            c, automaton = component_of(system, one)
            if automaton.modes[self.z[c]] != one.source:
                return False
            number = guard_number(system, one)
            if number < 0:
                return True
            chosen = ((number,), ())
        values = self._with_discrete(p)
        at = Place(s, origin, self.x, values, self._reading(), self.Y, self.Yd, self.shift, self.large)
        (found,) = self._changes.of(at, *chosen)
        has_fired = found.is_near or (one.kind != "monitor" and found.value <= 0.0)
        later = np.zeros(self.Y.shape[1])
        if has_fired and self._has_moved and found.is_zero and found.moves.any():
            is_guard = one.kind != "monitor"
            name = f"guard {one.guard} of {one.component}" if is_guard else f"monitor {one.component}"
            speed = found.along(rates_of(system, s, self.x, values, self.z))
            other = found.moves & (found.by > 0.0) if is_guard else found.moves
            is_lost = speed >= 0.0 or not is_guard
            later = later if is_lost else np.where(other, -found.by / speed, 0.0)
            lost = other if is_lost else np.zeros_like(other)
            self.off.append(OffZero(origin + s, name, found.moves, lost, np.zeros(self.Y.shape)))
        if has_fired:
            self._later.append(later)
        return has_fired

    def _delay(self, p: np.ndarray, s: float, origin: float, fired: Sequence[Occurrence]) -> None:
        """Compute derivatives for guards that are zero at the start and fire later if the start changes a little.

        They must fire together, and no other event may happen before that.
        """
        system, later, values = self.system, self._later[0], self._with_discrete(p)
        at = Place(s, origin, self.x, values, self.z, self.Y, self.Yd, self.shift, self.large)
        apart = [np.abs(other - later) > _ALIKE * (np.abs(other) + np.abs(later)) for other in self._later]
        lost, names = np.any(apart, axis=0), [f"guard {one.guard} of {one.component}" for one in fired]
        for c, _ in self._loose:  # which begins to hold on the way there
            free, k = replace(at, z=self._reading()), system.surface_of.index(c)
            lost |= self._changes.of(free, surfaces=(k,))[0].moves & (later > 0.0)
        if lost.any():
            self.off.append(self.off[-1]._replace(lost=lost))
        for one in off_zero(self._changes, at)[1] if later.any() else ():
            earlier = (one.lost | one.more.any(axis=0)) & (later > 0.0)
            if one.name not in names and earlier.any():
                self.overtaken.append(one._replace(lost=earlier, more=np.zeros_like(one.more)))
        self.Y = self.Y + np.outer(rates_of(system, s, self.x, values, self.z), later)
        self.shift = self.shift + later

    def _reading(self) -> np.ndarray:
        """Return the modes that hold before components enter their holding modes at this instant."""
        z = self.z.copy()
        for c, mode in self._loose:
            z[c] = mode
        return z

    def _with_discrete(self, p: np.ndarray) -> np.ndarray:
        values = p.copy()
        values[self.system.layout.discrete_slice] = self.d
        return values

    def _apply(self, fired: Sequence[Occurrence], p: np.ndarray, s: float, origin: float) -> None:
        """Apply all resets of one round to the state before the round; additive resets are summed."""
        system, n = self.system, self.system.n
        values = self._with_discrete(p)
        x, lifted = self._lifted(values)
        before = [*x, *lifted[system.layout.discrete_slice]]
        after, width = list(before), self.Y.shape[1]
        modes = self.z.copy()
        for one in fired:
            key = self._key(one, values, s)
            if one.kind not in ("monitor", "scheduled"):
                c, automaton = component_of(system, one)
                modes[c] = automaton.modes.index(one.target)
                self.has_jumped |= not (automaton.has_surface or automaton.is_corner)
            if key not in system.resets:
                continue
            self.has_reset = self.has_jumped = True
            amounts = set(system.resets[added(key)][1]) if added(key) in system.resets else set()
            for part, names in ((key, set(system.resets[key][1]) - amounts), (added(key), amounts)):
                if not names:
                    continue
                out = list(before)
                z = np.array([*self._reading(), system.resets[part][0]])
                self._reset(Dual(s, self.shift), x, lifted, z, out)
                corners = self._corners.beside(key, (Dual(s, self.shift), x, lifted), z, before)
                if corners.any():
                    what, none = f"a corner in a reset of {one.component}", np.zeros(self.Y.shape)
                    self.off.append(OffZero(origin + s, what, corners, corners, none))
                for name in names:
                    k = self._names.index(name)
                    after[k] = out[k] if part is key else after[k] + out[k]
        closing = [c for one in fired if (c := self._closing(one)) >= 0]
        if self._impacts is not None and closing:
            self.has_reset = self.has_jumped = True
            time = Dual(s, self.shift)
            after[:n] = self._impacts.after(closing, origin + s, time, after[:n], lifted, self._reading())
        found, slopes = values_and_slopes(after, width)
        self._has_moved = True
        self.x, self.d, self.Y, self.Yd = found[:n], found[n:], slopes[:n], slopes[n:]
        self.z = modes

    def _closing(self, one: Occurrence) -> int:
        """Return the component of a unilateral contact whose gap closes with an impact, or -1."""
        if one.kind in ("monitor", "scheduled") or one.guard == LIMIT:
            return -1
        c, automaton = component_of(self.system, one)
        return c if automaton.is_unilateral and automaton.modes.index(one.source) == automaton.above else -1

    def _lifted(self, p: np.ndarray) -> tuple[list[Dual], list[Any]]:
        """Return the states and the run-time values as dual numbers, that is, with their derivatives."""
        return with_slopes(self.x, self.Y), self._vector.lifted(p, self.d, self.Yd, self._G)

    def _key(self, one: Occurrence, p: np.ndarray, s: float) -> tuple[Any, ...]:
        system = self.system
        if one.kind == "monitor":
            return "monitor", system.monitor_names.index(one.component)
        if one.kind == "scheduled":
            names = [schedule.name for schedule in system.model.schedules]
            return "schedule", names.index(one.component) if one.component in names else -1
        c, automaton = component_of(system, one)
        if automaton.has_surface:
            return ("none",)
        if guard_number(system, one) < 0:
            return ("limit", c) if one.guard == LIMIT else ("none",)
        m = automaton.modes.index(one.source)
        g = automaton.guard_names[m].index(one.guard)
        return "choice", c, m, g, system.choose(c, m, g, s, self.x, p, self.z)


def is_recorded(system: System, one: Occurrence) -> bool:
    """Return whether an event is a monitor event that changes nothing."""
    if one.kind != "monitor":
        return False
    key = "monitor", system.monitor_names.index(one.component)
    return key not in system.resets and added(key) not in system.resets


def component_of(system: System, one: Occurrence) -> tuple[int, Any]:
    """Return the index and the automaton of the component of a transition."""
    c = [a.name for a in system.automata].index(one.component)
    return c, system.automata[c]


def guard_number(system: System, one: Occurrence) -> int:
    """Return the number of the guard that caused a transition, or -1 if the transition had another cause."""
    _, automaton = component_of(system, one)
    m = automaton.modes.index(one.source)
    names = automaton.guard_names[m]
    return automaton.guards[m][names.index(one.guard)] if one.guard in names else -1
