"""Derivatives carried along a run: over its segments by the variational flow, through its events by saltation.

At an event the time of which moves by dt, a change dx of the state before it becomes

    dx+ = R_x (dx- + f- dt) + R_t dt + R_p - f+ dt,    dt = -(g_x dx- + g_p)/(g_t + g_x f-),

with the reset R, the guard g and the rates f-, f+ on both sides (M. A. Aizerman and F. R. Gantmacher, Quart. J. Mech.
Appl. Math. 11 (1958) 52; M. di Bernardo et al., Piecewise-smooth Dynamical Systems, Springer 2008, section 2.5). Where
a mode holds a state on a constraint, its derivative is that of the constraint: what stick takes away is exactly zero.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.analysis.variations.parameters import expression_slope
from hybridsim.analysis.variations.rounds import (
    Rounds,
    batches,
    component_of,
    guard_number,
    is_knot,
    lifted_vector,
)
from hybridsim.analysis.variations.sizes import sizes
from hybridsim.analysis.variations.smooth import transition
from hybridsim.engine.dual_numbers import Dual, differentiated, values_and_slopes, with_slopes
from hybridsim.engine.tangents import TangentTape
from hybridsim.errors import UsageError
from hybridsim.expr import evaluate

if TYPE_CHECKING:
    from hybridsim.engine.pieces import Occurrence, Segment
    from hybridsim.engine.system import System
    from hybridsim.solution import Solution

_ALIKE = 1e-7  # events at one instant are one event if their times change alike to that part
_AT_ZERO = 1e-9  # of a guard's terms
_TANGENTIAL = (
    1e-9  # a guard that falls by less than this part of its terms leaves the time of its event undefined
)


@dataclass(frozen=True)
class Directions:
    """What is changed: M directions in the states, the discrete states and the parameters.

    x (n, M), discrete (d, M), parameters (P, M): the derivatives at the start of the run.
    """

    x: np.ndarray
    discrete: np.ndarray
    parameters: np.ndarray


@dataclass(frozen=True)
class Carried:
    """Derivatives at the end of a run, and of the time of each event on the way.

    x (n, M), discrete (d, M); times: of each instant at which something happened, with its derivatives (M,).
    """

    x: np.ndarray
    discrete: np.ndarray
    times: list[tuple[float, np.ndarray]]


class Carrier:
    """Carries derivatives along one run."""

    def __init__(self, solution: Solution) -> None:
        self.solution = solution
        self.system: System = solution._system
        if not self.system.has_tape:
            raise UsageError(
                f"model {solution.model.name} is made of Python functions, of which derivatives are not known",
                remedy="write it in expressions",
            )
        if self.system.is_unilateral.any():
            raise UsageError(
                f"model {solution.model.name} has impacts, through which derivatives are not carried",
                remedy="write it with a guard and a reset, or compare runs with parameters that differ",
            )
        module: Any = self.system.code.module
        self._project, self._rates = (differentiated(f) for f in (module.project, module.rates))
        largest = sizes(solution)
        self._scale = np.where(largest > 0.0, largest, 1.0)

    def carry(self, directions: Directions) -> Carried:
        """From the first segment to the end of the last."""
        self._refuse_inputs(directions.parameters)
        Y, Yd = directions.x.copy(), directions.discrete.copy()
        times: list[tuple[float, np.ndarray]] = []
        stretches = list(self._stretches())
        Y, Yd = self._started(stretches[0][0], Y, Yd, directions.parameters)
        for (segment, happened), (following, _) in zip(stretches, [*stretches[1:], (None, ())], strict=True):
            Y = self._over(segment, Y, Yd, directions.parameters)
            if following is None:
                break
            Y, Yd, shift = self._through(segment, happened, following, Y, Yd, directions.parameters)
            if any(one.kind != "corner" for one in happened):
                times.append((float(following.start), shift))
        return Carried(Y, Yd, times)

    def _stretches(self) -> Iterator[tuple[Segment, tuple[Occurrence, ...]]]:
        """Segments, each with what happened at its end and changed modes or states."""
        waiting = [o for o in self.solution._trajectory.occurrences if o.kind != "near-grazing"]
        at = 0
        for segment in self.solution._segments:
            end = segment.end
            # an event and the end of its segment are one instant but for that
            rounding = 4.0 * math.ulp(float(end))
            while at < len(waiting) and waiting[at].instant.minus(end) < -rounding:
                at += 1
            first = at
            while at < len(waiting) and waiting[at].instant.minus(end) <= rounding:
                at += 1
            yield segment, tuple(waiting[first:at])

    def _started(
        self, segment: Segment, Y: np.ndarray, Yd: np.ndarray, G: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives behind what happened at the first instant itself."""
        happened = at_start(self.solution)
        scheduled = [one for one in happened if one.kind == "scheduled"]
        if scheduled and self._scheduled_shift(scheduled, G).any():
            raise UsageError(
                f"{scheduled[0].component} happens at the start of the run, and its time depends on what is changed",
                remedy="begin the run a little earlier or later",
            )
        if happened:
            z = segment.z.copy()
            for one in reversed(happened):
                if one.kind not in ("monitor", "scheduled"):
                    c, automaton = component_of(self.system, one)
                    z[c] = automaton.modes.index(one.source)
            before = happened[0].x_minus, self.system.discrete_start, z
            rounds = self._rounds(before, Y, Yd, G, np.zeros(Y.shape[1]))
            for batch in batches(happened):
                rounds.at_appointment(segment.start, batch)
            Y, Yd = rounds.Y, rounds.Yd
        return self._projected(segment, Y, Yd, G), Yd

    def _rounds(
        self,
        before: tuple[np.ndarray, np.ndarray, np.ndarray],
        Y: np.ndarray,
        Yd: np.ndarray,
        G: np.ndarray,
        shift: np.ndarray,
    ) -> Rounds:
        return Rounds(self.system, *before, Y, Yd, G, self._rate_slopes() @ G, shift, self._scale)

    def _refuse_inputs(self, G: np.ndarray) -> None:
        """Derivatives of an input's shape by its parameters are not known."""
        moving = {p.name for p, row in zip(self.system.model.parameters, G, strict=True) if row.any()}
        starts = {part.name: part.start.names for part in self.system.model.discrete}
        for declared in self.system.model.inputs:
            names = {n for e in declared.expressions.values() for n in e.names}
            used = sorted(moving & names.union(*(starts.get(name, ()) for name in names)))
            if used:
                raise UsageError(
                    f"{declared.subject} depends on {used[0]}, and its derivative by that is not known",
                    remedy=f"leave {used[0]} out, or write the input as an expression of t"
                    if declared.kind != "step"
                    else f"leave {used[0]} out, or let a schedule at that time reset a discrete state",
                )

    # -- between events -------------------------------------------------------------------------------------

    def _over(self, segment: Segment, Y: np.ndarray, Yd: np.ndarray, G: np.ndarray) -> np.ndarray:
        if segment.s[-1] <= segment.s[0] or not self.system.n:
            return Y
        tape, seeds = TangentTape(self.system, segment.z), self._seeds(segment)
        n = self.system.n
        constant = np.concatenate([Yd, G])
        moving = [k for k in range(len(constant)) if constant[k].any()]
        chosen = [*range(n), *(n + 1 + k for k in moving)]

        def slopes(s: np.ndarray) -> np.ndarray:
            return tape(s, segment.dense(s), segment.p, seeds[:, chosen]).slopes

        values = np.abs(np.concatenate([self.system.discrete(segment.p), segment.p[: len(G)]]))[moving]
        total = transition(slopes, segment.s, self._scale, np.where(values > 0.0, values, 1.0))
        Y = total[:, :n] @ Y + total[:, n:] @ constant[moving]
        return self._projected(segment, Y, Yd, G, at_end=True)

    def _seeds(self, segment: Segment) -> np.ndarray:
        """Directions of the states, local time, discrete states and parameters in all that the tape reads."""
        system = self.system
        layout, n = system.layout, system.n
        P, d = layout.parameters, layout.discrete
        seeds = np.zeros((n + 1 + layout.size, n + 1 + d + P))
        seeds[: n + 1, : n + 1] = np.eye(n + 1)
        seeds[n + 1 + layout.discrete_at : n + 1 + layout.discrete_at + d, n + 1 : n + 1 + d] = np.eye(d)
        seeds[n + 1 : n + 1 + P, n + 1 + d :] = np.eye(P)
        for k, row in enumerate(self._rate_slopes()):  # an angle rate*origin
            seeds[n + 1 + layout.phases_at + k, n + 1 + d :] = float(segment.origin) * row
        return seeds

    def _rate_slopes(self) -> np.ndarray:
        layout = self.system.layout
        P = layout.parameters
        p: list[Any] = list(self.system.vector(self.solution._segments[0].origin, np.zeros(layout.discrete)))
        p[:P] = with_slopes(p[:P], np.eye(P))
        out: list[Any] = [0.0] * layout.phases
        self._rates(0.0, [], p, [], out)
        return values_and_slopes(out, P)[1]

    # -- at events ------------------------------------------------------------------------------------------

    def _through(
        self,
        segment: Segment,
        happened: tuple[Occurrence, ...],
        following: Segment,
        Y: np.ndarray,
        Yd: np.ndarray,
        G: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        system, s = self.system, float(segment.s[-1])
        x = segment.x[-1]
        shift = self._shift(segment, happened, s, x, Y, Yd, G)
        before = rates_of(system, s, x, segment.p, segment.z)
        Y = Y + np.outer(before, shift)
        rounds = self._rounds((x, system.discrete(segment.p), segment.z), Y, Yd, G, shift)
        groups = batches(happened)
        for k, batch in enumerate(groups):
            is_due = any(one.kind == "scheduled" for one in batch) or (
                k == len(groups) - 1 and is_knot(system, following.start)
            )
            if is_due:
                rounds.at_appointment(following.start, batch)
            else:
                rounds.at_end(segment, batch)
        Y, Yd = rounds.Y, rounds.Yd
        after = rates_of(system, float(following.s[0]), following.x[0], following.p, following.z)
        Y = Y - np.outer(after, shift)
        return self._projected(following, Y, Yd, G), Yd, shift

    def _shift(
        self,
        segment: Segment,
        happened: tuple[Occurrence, ...],
        s: float,
        x: np.ndarray,
        Y: np.ndarray,
        Yd: np.ndarray,
        G: np.ndarray,
    ) -> np.ndarray:
        """Derivatives of the time of what happened (M,): of everything that came about by itself, the same."""
        scheduled = [o for o in happened if o.kind == "scheduled"]
        if not happened:
            return np.zeros(G.shape[1])
        shifts = [self._scheduled_shift([o], G) for o in scheduled]
        if is_knot(self.system, segment.end):  # inputs whose knots move are refused
            shifts.append(np.zeros(G.shape[1]))
        for one in happened:
            if one.kind == "monitor" or one.guard:
                shift = self._located_shift(segment, one, s, x, Y, Yd, G, is_first=not shifts)
                shifts += [] if shift is None else [shift]
        if not shifts:
            raise UsageError(
                f"what set off the change of {happened[0].component} at t = {float(happened[0].instant):.9g} is not "
                "known, and so the derivatives of its time are not",
                remedy="take other parameters, or a run that ends before",
            )
        largest = max(np.abs(shift).max(initial=0.0) for shift in shifts)
        if any((np.abs(shift - shifts[0]) > _ALIKE * largest).any() for shift in shifts):
            raise UsageError(
                f"several events at t = {float(happened[0].instant):.9g} move apart when the run is changed: "
                f"{', '.join(sorted({o.component for o in happened}))}; there is no derivative",
                remedy="take other parameters, or a run that ends before",
            )
        return shifts[0]

    def _located_shift(
        self,
        segment: Segment,
        one: Occurrence,
        s: float,
        x: np.ndarray,
        Y: np.ndarray,
        Yd: np.ndarray,
        G: np.ndarray,
        is_first: bool,
    ) -> np.ndarray | None:
        """Of an event at a zero of a guard or monitor; None for one that followed from another."""
        system, n = self.system, self.system.n
        is_monitor = one.kind == "monitor"
        if is_monitor:
            number = system.monitor_names.index(one.component)
        else:
            c, automaton = component_of(system, one)
            number = guard_number(system, one)
            if number < 0 or automaton.modes[segment.z[c]] != one.source:
                return None
        tape = TangentTape(system, segment.z, *(((), (number,)) if is_monitor else ((number,), ())))
        found = tape(np.array([s]), x[None, :], segment.p, self._seeds(segment))
        row = found.slopes[0, n]
        terms = np.append(row[:n] * found.values[0, :n], row[n])
        size = np.abs(row[:n]) @ self._scale
        if not is_first and abs(found.values[0, n]) > _AT_ZERO * size:
            return None
        rate = terms.sum()
        if not abs(rate) > _TANGENTIAL * np.abs(terms).sum():
            if not is_first:
                return None
            raise UsageError(
                f"{one.component} has an event at t = {float(one.instant):.9g} at which its guard does "
                "not fall: the time of such an event has no derivatives",
                remedy="take other parameters, or a run that ends before",
            )
        change = row[:n] @ Y + row[n + 1 :] @ np.concatenate([Yd, G])
        return -change / rate

    def _scheduled_shift(self, scheduled: list[Occurrence], G: np.ndarray) -> np.ndarray:
        model, shift = self.system.model, np.zeros(G.shape[1])
        if not scheduled:
            return shift
        slopes = {p.name: row for p, row in zip(model.parameters, G, strict=True)}
        declared = next((c for c in model.schedules if c.name == scheduled[0].component), None)
        if declared is None:
            return shift
        values, t = self.system.values, float(scheduled[0].instant)
        if declared.start is None or declared.period is None:
            single = min(declared.times, key=lambda e: abs(evaluate(e, values) - t))
            return expression_slope(single, values, slopes, G.shape[1])
        k = round((t - evaluate(declared.start, values)) / evaluate(declared.period, values))
        by_start = expression_slope(declared.start, values, slopes, G.shape[1])
        return by_start + k * expression_slope(declared.period, values, slopes, G.shape[1])

    def _projected(
        self, segment: Segment, Y: np.ndarray, Yd: np.ndarray, G: np.ndarray, at_end: bool = False
    ) -> np.ndarray:
        """Derivatives of the states with the held ones on their constraints."""
        system, k = self.system, -1 if at_end else 0
        if not system.holds(segment.z):
            return Y
        by_angles = self._rate_slopes() @ G * float(segment.origin)
        p = lifted_vector(system.layout, segment.p, G, by_angles, system.discrete(segment.p), Yd)
        x = with_slopes(segment.x[k], Y)
        out: list[Any] = [0.0] * system.n
        self._project(float(segment.s[k]), x, p, segment.z, out)
        return values_and_slopes(out, Y.shape[1])[1]


def at_start(solution: Solution) -> list[Occurrence]:
    """What happened at the first instant of a run."""
    first = solution._segments[0].start
    found = []
    for one in solution._trajectory.occurrences:
        if one.instant.minus(first) > 0.0:
            break
        found.append(one)
    return found


def rates_of(system: System, s: float, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> np.ndarray:
    """dx/dt (n,) as the states move: those that a mode holds go with their constraint, which no flow says."""
    rates = system.flow(s, x, p, z)
    if not system.holds(z):
        return rates
    out: list[Any] = [0.0] * system.n
    module: Any = system.code.module
    lifted = with_slopes(x, rates[:, None])
    differentiated(module.project)(Dual(s, np.ones(1)), lifted, [float(v) for v in p], z, out)
    return values_and_slopes(out, 1)[1][:, 0]
