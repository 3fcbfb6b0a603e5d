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

from hybridsim.analysis.variations.event_times import EventTimes
from hybridsim.analysis.variations.rounds import Rounds, batches, component_of, is_knot, lifted_vector
from hybridsim.analysis.variations.seeds import rate_slopes, seeds
from hybridsim.analysis.variations.sizes import sizes
from hybridsim.analysis.variations.smooth import transition
from hybridsim.engine.dual_numbers import Dual, differentiated, values_and_slopes, with_slopes
from hybridsim.engine.tangents import TangentTape
from hybridsim.errors import UsageError

if TYPE_CHECKING:
    from hybridsim.engine.pieces import Occurrence, Segment
    from hybridsim.engine.system import System
    from hybridsim.solution import Solution


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


@dataclass(frozen=True)
class Stretch:
    """A segment, the monitors that were recorded along it, and what happened between its end and the next one."""

    segment: Segment
    recorded: tuple[Occurrence, ...]
    happened: tuple[Occurrence, ...]


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
        self._project = differentiated(module.project)
        self._rates = rate_slopes(self.system, solution._segments[0].origin)
        largest = sizes(solution)
        self._scale = np.where(largest > 0.0, largest, 1.0)

    def carry(self, directions: Directions) -> Carried:
        """From the first segment to the end of the last."""
        G = directions.parameters
        self._refuse_inputs(G)
        Y, Yd = directions.x.copy(), directions.discrete.copy()
        event_times = EventTimes(self.system, self._scale, self._own_sizes(directions), G, self._rates)
        times: list[tuple[float, np.ndarray]] = []
        stretches = list(self._stretches())
        Y, Yd = self._started(stretches[0].segment, Y, Yd, G, event_times)
        for stretch, following in zip(stretches, [*stretches[1:], None], strict=True):
            segment, s = stretch.segment, float(stretch.segment.s[0])
            for one in stretch.recorded:
                here = one.instant.minus(segment.origin)
                Y, s = self._over(segment, Y, Yd, G, s, here), here
                x = segment.dense(np.array([here]))[0]
                times.append((float(one.instant), event_times.of(segment, (one,), here, x, Y, Yd)))
            Y = self._over(segment, Y, Yd, G, s, float(segment.s[-1]))
            if following is None:
                break
            Y, Yd, shift = self._through(stretch, following.segment, Y, Yd, G, event_times)
            if any(one.kind != "corner" for one in stretch.happened):
                times.append((float(following.segment.start), shift))
        return Carried(Y, Yd, times)

    def _own_sizes(self, directions: Directions) -> np.ndarray:
        """The change along each direction (M,) that is as large as the first of what it changes."""
        system = self.system
        constants = np.abs(np.concatenate([system.discrete_start, list(system.values.values())]))
        scale = np.concatenate([self._scale, np.where(constants > 0.0, constants, 1.0)])
        changes = np.concatenate([directions.x, directions.discrete, directions.parameters])
        relative = (np.abs(changes) / scale[:, None]).max(axis=0)
        return 1.0 / np.where(relative > 0.0, relative, 1.0)

    def _stretches(self) -> Iterator[Stretch]:
        """Segments, each with what happened until the next one begins and changed modes or states."""
        waiting = [o for o in self.solution._trajectory.occurrences if o.kind != "near-grazing"]
        at, segments = 0, list(self.solution._segments)
        for segment, following in zip(segments, [*segments[1:], None], strict=True):
            # an event and the end of its segment are one instant but for that
            rounding = 4.0 * math.ulp(float(segment.end))
            # where events accumulate, the next segment begins at their limit
            until = segment.end if following is None else following.start
            recorded = []
            while at < len(waiting) and waiting[at].instant.minus(segment.end) < -rounding:
                if waiting[at].kind == "monitor" and waiting[at].instant.minus(segment.start) > 0.0:
                    recorded.append(waiting[at])
                at += 1
            first = at
            while at < len(waiting) and waiting[at].instant.minus(until) <= rounding:
                at += 1
            yield Stretch(segment, tuple(recorded), tuple(waiting[first:at]))

    def _started(
        self, segment: Segment, Y: np.ndarray, Yd: np.ndarray, G: np.ndarray, event_times: EventTimes
    ) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives behind what happened at the first instant itself."""
        happened = at_start(self.solution)
        for one in happened:
            if one.kind == "scheduled" and any(shift.any() for shift in event_times.scheduled(one)):
                raise UsageError(
                    f"{one.component} happens at the start of the run, and its time depends on what is changed",
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
        return Rounds(self.system, *before, Y, Yd, G, self._rates @ G, shift, self._scale)

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

    def _over(
        self, segment: Segment, Y: np.ndarray, Yd: np.ndarray, G: np.ndarray, begin: float, end: float
    ) -> np.ndarray:
        """Over a segment from one local time to another."""
        if end <= begin or not self.system.n:
            return Y
        tape, directions = TangentTape(self.system, segment.z), seeds(self.system, segment, self._rates)
        n = self.system.n
        constant = np.concatenate([Yd, G])
        moving = [k for k in range(len(constant)) if constant[k].any()]
        chosen = [*range(n), *(n + 1 + k for k in moving)]

        def slopes(s: np.ndarray) -> np.ndarray:
            return tape(s, segment.dense(s), segment.p, directions[:, chosen]).slopes

        values = np.abs(np.concatenate([self.system.discrete(segment.p), segment.p[: len(G)]]))[moving]
        inner = segment.s[(segment.s > begin) & (segment.s < end)]
        knots = np.concatenate([[begin], inner, [end]])
        total = transition(slopes, knots, self._scale, np.where(values > 0.0, values, 1.0))
        return self._projected(segment, total[:, :n] @ Y + total[:, n:] @ constant[moving], Yd, G, end)

    # -- at events ------------------------------------------------------------------------------------------

    def _through(
        self,
        stretch: Stretch,
        following: Segment,
        Y: np.ndarray,
        Yd: np.ndarray,
        G: np.ndarray,
        event_times: EventTimes,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        segment, happened = stretch.segment, stretch.happened
        system, s = self.system, float(segment.s[-1])
        x = segment.x[-1]
        shift = event_times.of(segment, happened, s, x, Y, Yd)
        before = rates_of(system, s, x, segment.p, segment.z)
        Y = Y + np.outer(before, shift)
        rounds = self._rounds((x, system.discrete(segment.p), segment.z), Y, Yd, G, shift)
        groups = batches(happened)
        for k, batch in enumerate(groups):
            is_due = (
                any(one.kind == "scheduled" for one in batch)
                or batch[0].instant.minus(segment.end) > 0.0  # the limit of a series
                or (k == len(groups) - 1 and is_knot(system, following.start))
            )
            if is_due:
                rounds.at_appointment(following.start, batch)
            else:
                rounds.at_end(segment, batch)
        Y, Yd = rounds.Y, rounds.Yd
        after = rates_of(system, float(following.s[0]), following.x[0], following.p, following.z)
        Y = Y - np.outer(after, shift)
        return self._projected(following, Y, Yd, G), Yd, shift

    def _projected(
        self, segment: Segment, Y: np.ndarray, Yd: np.ndarray, G: np.ndarray, s: float | None = None
    ) -> np.ndarray:
        """Derivatives of the states with the held ones on their constraints: at a local time, or at the start."""
        system = self.system
        if not system.holds(segment.z):
            return Y
        here = float(segment.s[0]) if s is None else s
        at = segment.x[0] if s is None else segment.dense(np.array([s]))[0]
        by_angles = self._rates @ G * float(segment.origin)
        p = lifted_vector(system.layout, segment.p, G, by_angles, system.discrete(segment.p), Yd)
        out: list[Any] = [0.0] * system.n
        self._project(here, with_slopes(at, Y), p, segment.z, out)
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
