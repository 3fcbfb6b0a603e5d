"""This module computes derivatives along a run, with saltation matrices at events.

At an event whose time changes by dt, a change dx of the state before it becomes

    dx+ = R_x (dx- + f- dt) + R_t dt + R_p - f+ dt,    dt = -(g_x dx- + g_p)/(g_t + g_x f-),

with the reset R, the guard g and the rates f-, f+ on both sides (M. A. Aizerman and F. R. Gantmacher, Quart. J. Mech.
Appl. Math. 11 (1958) 52; M. di Bernardo et al., Piecewise-smooth Dynamical Systems, Springer 2008, section
2.5). If a mode holds a state on a constraint, its derivative is that of the constraint, so that stick removes
a change exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hybridsim.analysis.variations.changes import Changes, Place
from hybridsim.analysis.variations.compiled.ordinary import NotOrdinary, are_of_the_model, passages_of
from hybridsim.analysis.variations.compiled.passages import carry_ordinary
from hybridsim.analysis.variations.directions import Carried, Directions
from hybridsim.analysis.variations.event_times import EventTimes
from hybridsim.analysis.variations.flow_derivatives import FlowDerivatives
from hybridsim.analysis.variations.off_zero import (
    OffZero,
    beyond,
    differ,
    limits_reached,
    off_zero,
    rates_of,
)
from hybridsim.analysis.variations.rounds import Rounds, batches, component_of, is_knot, is_recorded
from hybridsim.analysis.variations.segment_events import (
    Last,
    SegmentEvents,
    at_start,
    segment_events_of,
    time_rounding,
)
from hybridsim.analysis.variations.sizes import sizes
from hybridsim.analysis.variations.values.table_slopes import TableValue
from hybridsim.analysis.variations.values.vector_slopes import VectorSlopes
from hybridsim.analysis.variations.zeros.monitors import monitors_reached
from hybridsim.analysis.variations.zeros.staying import Staying
from hybridsim.engine.native.kernels import Precompiled
from hybridsim.engine.record.segments import Segment
from hybridsim.engine.system.system import System
from hybridsim.errors import UsageError
from hybridsim.solution import Solution

_ROUNDING = 1e-11  # of a run's length, for a change of its own size: a time that moves by less does not move
_carry_ordinary = Precompiled(carry_ordinary)
_SAME = 1e-9  # of its size: a state that changes by less at an event does not jump


class Carrier:
    """Computes derivatives along one run."""

    def __init__(self, solution: Solution, tables: Sequence[TableValue] = ()) -> None:
        self.solution = solution
        self.system: System = solution._system
        if not self.system.has_tape:
            raise UsageError(
                f"model {solution.model.name} consists of Python functions, whose derivatives are unknown",
                remedy="write the model in expressions",
            )
        if self.system.numbers:
            raise UsageError(
                f"model {solution.model.name} contains floor, mod or round, through which derivatives are unknown",
                remedy="use differences of runs",
            )
        largest = sizes(solution)
        self._scale = np.where(largest > 0.0, largest, 1.0)
        self._vector = VectorSlopes(self.system, solution._segments[0].origin, tables)
        self._flow = FlowDerivatives(solution, self._scale, self._vector)
        self._end = solution._segments[-1].end
        self._rounding = time_rounding(solution)

    def carry(self, directions: Directions, *, sided: bool = False) -> Carried:
        """Compute the derivatives along M directions of change from the start of the run to its end.

        sided : whether a direction that moves a function off zero is followed on its side, not on that of the run.
        """
        G = directions.parameters
        self._sided, self._lost = sided, np.full(G.shape[1], np.inf)
        Y, Yd = directions.x.copy(), directions.discrete.copy()
        self._changes = Changes(self.system, self._scale, self.own_sizes(directions), G, self._vector)
        self._off: list[OffZero] = []
        self._staying = Staying()
        event_times, last = EventTimes(self._changes), None
        times: list[tuple[float, np.ndarray]] = []
        starts: list[tuple[np.ndarray, np.ndarray]] = []
        shifts = [np.zeros(G.shape[1])]
        Y, Yd = self._started(self.solution._segments[0], Y, Yd, G, event_times)
        self._flow.prepare(Yd, G)
        Y = self._followed(0, Y, Yd, G, np.zeros(G.shape[1]))
        found = None if sided or self._staying else self._ordinary(Y, Yd, G)
        if found is not None:
            return found
        all_segment_events = list(segment_events_of(self.solution))
        if any(not is_recorded(self.system, one) for one in all_segment_events[-1].happened):
            whole = all_segment_events[-1].segment  # at the end, and left the states and modes as they were
            all_segment_events.append(SegmentEvents(replace(whole, s=whole.s[-1:], x=whole.x[-1:]), (), ()))
        for number, (segment_events, following) in enumerate(
            zip(all_segment_events, [*all_segment_events[1:], None], strict=True)
        ):
            segment = segment_events.segment
            starts.append((Y, Yd))
            stops = [one.instant.minus(segment.origin) for one in segment_events.recorded]
            if len(segment.s) > 1:
                *passed, Y = self._flow.over(number, Y, Yd, G, np.array([*stops, segment.s[-1]]))
                for one, s, there in zip(segment_events.recorded, stops, passed, strict=True):
                    x = segment.dense(np.array([s]))[0]
                    times.append((float(one.instant), event_times.recorded(segment, one, s, x, there, Yd)))
            if following is None:
                break
            behind = self._through(segment_events, following.segment, Y, Yd, G, event_times)
            if self._is_end(following.segment) and last is None:
                last = Last(segment, Y, Yd, behind[2], segment_events.happened)
            Y, Yd, shift = behind
            if number + 1 < len(self.solution._segments):
                Y = self._followed(number + 1, Y, Yd, G, shift)
            shifts.append(np.where(self._moves(shift), shift, 0.0))
            if any(one.kind != "corner" for one in segment_events.happened):
                times.append((float(following.segment.start), shift))
        if last is not None:
            Y, Yd = self._at_end(last, all_segment_events[-1].segment, Y, Yd)
            starts[-1] = Y, Yd
        return Carried(Y, Yd, times, self._off, self._lost, starts, shifts, self._staying.stays_zero)

    def _ordinary(self, Y: np.ndarray, Yd: np.ndarray, G: np.ndarray) -> Carried | None:
        """Carry derivatives from start to end in compiled code; return None if an event of the run is not ordinary."""
        regular = self._flow.regular()
        if regular is None or not self._vector.is_fixed:
            return None
        parts, moving = regular
        try:
            guards, passages = passages_of(self.solution, self._vector, moving, parts, self._rounding)
        except NotOrdinary:
            return None
        starts, shifts = np.empty((len(guards), *Y.shape)), np.zeros((len(guards), Y.shape[1]))
        starts[0], end = Y, np.empty(Y.shape)
        _carry_ordinary(passages, np.concatenate([Yd, G])[moving], starts, shifts, end, np.empty(Y.shape))
        segments = self.solution._segments
        begins = segments.origins().sum(axis=1) + segments.spans()[:, 0]
        shown = np.flatnonzero(are_of_the_model(self.system, guards)) + 1
        times = [(float(begins[i]), shifts[i]) for i in shown]
        moved = np.where(self._moves(shifts), shifts, 0.0)
        return Carried(end, Yd, times, self._off, self._lost, [(one, Yd) for one in starts], list(moved))

    def between(self, carried: Carried, directions: Directions, number: int, stops: np.ndarray) -> np.ndarray:
        """Return the derivatives (k, n + d, M) of states and discrete states at k local times of one segment."""
        Y, Yd = carried.starts[number]
        self._flow.prepare(Yd, directions.parameters)
        x = self._flow.over(number, Y, Yd, directions.parameters, stops)
        return np.concatenate([x, np.broadcast_to(Yd, (len(stops), *Yd.shape))], axis=1)

    def _is_end(self, segment: Segment) -> bool:
        """Return whether a segment begins at the end of the run, within rounding."""
        return bool(segment.start.minus(self._end) >= -self._rounding)

    def _moves(self, shift: np.ndarray) -> np.ndarray:
        """Return a mask (M,) of the directions in which a time with the derivatives `shift` changes."""
        length = self.solution.t_end - self.solution.t_start
        return np.asarray(np.abs(shift) * self._changes.own > _ROUNDING * length)

    def _at_end(
        self, last: Last, behind: Segment, Y: np.ndarray, Yd: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivatives for an event exactly at the end, which a small change may move beyond the end."""
        before, system = last.segment, self.system
        moves = self._moves(last.shift)
        jumps = bool(
            (np.abs(before.x[-1] - behind.x[0]) > _SAME * self._scale).any()
            or (system.discrete(before.p) != system.discrete(behind.p)).any()
        )
        if not moves.any() or not (jumps or differ(Y, last.Y)):
            return Y, Yd
        names = " and ".join(sorted({one.component for one in last.happened}))
        lost = moves & jumps
        self._note([OffZero(float(behind.end), f"the event of {names}", moves, lost, np.zeros(Y.shape))])
        if not self._sided:
            return Y, Yd
        is_later = last.shift > 0.0
        return np.where(is_later, last.Y, Y), np.where(is_later, last.Yd, Yd)

    def _note(self, off: list[OffZero]) -> np.ndarray | float:
        """Store the functions that are exactly zero, and return their contribution to the derivatives."""
        self._off += off
        if not self._sided:
            return 0.0
        lost, more = beyond(off, len(self._lost))
        self._lost[lost] = np.minimum(self._lost[lost], off[0].t if off else np.inf)
        return more

    def sizes(self) -> np.ndarray:
        """Return the sizes (n + d, 1) of the states and discrete states; all sizes are positive."""
        discrete = np.abs(self.system.discrete_start)
        return np.concatenate([self._scale, np.where(discrete > 0.0, discrete, 1.0)])[:, None]

    def own_sizes(self, directions: Directions) -> np.ndarray:
        """Return, for each direction, the smallest step that changes a state or constant by its own size."""
        system = self.system
        constants = np.abs(np.concatenate([system.discrete_start, self._vector.constants()]))
        scale = np.concatenate([self._scale, np.where(constants > 0.0, constants, 1.0)])
        changes = np.concatenate([directions.x, directions.discrete, directions.parameters])
        relative = (np.abs(changes) / scale[:, None]).max(axis=0)
        return 1.0 / np.where(relative > 0.0, relative, 1.0)

    def _started(
        self, segment: Segment, Y: np.ndarray, Yd: np.ndarray, G: np.ndarray, event_times: EventTimes
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivatives after the events at the start of the run."""
        happened = at_start(self.solution)
        for one in happened:
            if one.kind == "scheduled" and any(shift.any() for shift in event_times.scheduled(one)):
                raise UsageError(
                    f"{one.component} has an event at the start of the run, at a time that depends on "
                    "the varied quantities",
                    remedy="begin the run a little earlier or later",
                )
        z = segment.z.copy()
        for one in reversed(happened):
            if one.kind not in ("monitor", "scheduled"):
                c, automaton = component_of(self.system, one)
                z[c] = automaton.modes.index(one.source)
        x = happened[0].x_minus if happened else segment.x[0]
        d = self.system.discrete_start if happened else self.system.discrete(segment.p)
        begun = self.solution._run.task.z0  # a component without a mode held nothing yet
        loose = [
            (c, a.above)
            for c, a in enumerate(self.system.automata)
            if a.has_surface and begun[c] < 0 and z[c] == a.hold
        ]
        rounds = self._rounds((x, d, z), Y, Yd, np.zeros(Y.shape[1]), np.abs(Y), loose, is_start=True)
        for batch in batches(happened):
            rounds.at_appointment(segment.start, batch)
        before = rates_of(self.system, float(segment.s[0]), x, segment.p, z)
        at = _place(rounds, segment)
        numbers = range(len(self.system.model.monitors))
        off, self._staying.monitors = monitors_reached(self._changes, at, segment, numbers)
        for name, by in self._vector.knots(segment.start):
            begins = by @ G  # a knot that moves off the start to a later time changes the run
            off.append(OffZero(at.origin + at.s, name, begins != 0.0, begins > 0.0, np.zeros(Y.shape)))
        Y = self._settled(rounds, segment, x, before) + self._note(off)
        return self._flow.projected(segment, Y, rounds.Yd, G), rounds.Yd

    def _rounds(
        self,
        before: tuple[np.ndarray, np.ndarray, np.ndarray],
        Y: np.ndarray,
        Yd: np.ndarray,
        shift: np.ndarray,
        large: np.ndarray,
        loose: Sequence[tuple[int, int]] = (),
        is_start: bool = False,
    ) -> Rounds:
        return Rounds(self.system, *before, Y, Yd, self._changes, shift, large, loose, is_start, self._sided)

    def _followed(
        self, number: int, Y: np.ndarray, Yd: np.ndarray, G: np.ndarray, shift: np.ndarray
    ) -> np.ndarray:
        """Return the derivatives at the start of a segment, corrected for functions that are zero there."""

        def over(stops: np.ndarray) -> np.ndarray:
            return self._flow.over(number, Y, Yd, G, stops)

        segment = self.solution._segments[number]
        return Y + self._note(self._staying.follow(self._changes, number, segment, Yd, shift, over))

    # -- at events ------------------------------------------------------------------------------------------

    def _through(
        self,
        segment_events: SegmentEvents,
        following: Segment,
        Y: np.ndarray,
        Yd: np.ndarray,
        G: np.ndarray,
        event_times: EventTimes,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        segment = segment_events.segment
        system, s = self.system, float(segment.s[-1])
        x = segment.x[-1]
        happened = [one for one in segment_events.happened if not is_recorded(system, one)]
        if not happened and segment_events.happened and not is_knot(system, following.start):
            return Y, Yd, event_times.recorded(segment, segment_events.happened[0], s, x, Y, Yd)
        shift = event_times.of(segment, happened, s, x, Y, Yd)
        before = rates_of(system, s, x, segment.p, segment.z)
        moved = np.outer(before, shift)
        large = np.maximum(np.abs(Y), np.abs(moved))

        def ran(z: np.ndarray) -> Rounds:
            rounds = self._rounds((x, system.discrete(segment.p), z), Y + moved, Yd, shift, large)
            rounds.run(segment, following.start, happened)
            return rounds

        rounds = ran(segment.z)
        at = Place(s, float(segment.origin), x, segment.p, segment.z, Y, Yd, np.zeros_like(shift), large)
        self._note(self._staying.at_resets(self._changes, at, rounds, ran))
        Yd, immediate = rounds.Yd, rounds.Y
        if self._is_end(following):  # a state off its surface has no time to return, and no guard fires
            later = self._moves(rounds.shift - shift)
            self._note([one._replace(lost=one.lost | later) for one in rounds.off])
            rounds.off.clear()
        if rounds.has_jumped or is_knot(system, following.start):
            Y = self._settled(rounds, following, x, before)
        else:
            changed = {
                component_of(system, one)[0] for one in happened if one.kind not in ("monitor", "scheduled")
            }
            surfaces = [c for c in sorted(changed) if system.automata[c].below >= 0]  # not gaps
            place = _place(rounds, following)
            more = self._note(limits_reached(self._changes, place, surfaces)) if surfaces else 0.0
            Y = rounds.Y + more - np.outer(self._rates_at_start(following), rounds.shift)
        Y = self._flow.projected(following, Y, Yd, G)
        return np.where(self._is_end(following) & ~self._moves(shift), immediate, Y), Yd, shift

    def _rates_at_start(self, segment: Segment) -> np.ndarray:
        return rates_of(self.system, float(segment.s[0]), segment.x[0], segment.p, segment.z)

    def _settled(self, rounds: Rounds, following: Segment, x: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Return the derivatives of the states just after an event, and store the functions that are zero there.

        x, before : states and rates (n,) before the instant.
        """
        after = _place(rounds, following)
        Y, off, zeros = off_zero(self._changes, after)
        self._staying.settle(zeros)
        rates = self._rates_at_start(following)
        if rounds.has_reset or (after.x != x).any() or differ(before, rates):
            off = [*rounds.off, *off]
        return Y + self._note([*rounds.overtaken, *off]) - np.outer(rates, rounds.shift)


def _place(rounds: Rounds, following: Segment) -> Place:
    """Return the point of the run just after an instant."""
    return Place(
        float(following.s[0]), float(following.origin), following.x[0], following.p, following.z,
        rounds.Y, rounds.Yd, rounds.shift, rounds.large,
    )  # fmt: skip
