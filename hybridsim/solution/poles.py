"""This module ends a run at a pole of its rates, because results beyond a pole have no meaning.

A zero of a denominator is not a pole if the rates are continuous there, as in sin(x)/x; the run then
continues.
"""

from __future__ import annotations

import math

import numpy as np

from hybridsim.engine.record.blocks import OccurrenceList, SegmentList
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.segments import Segment
from hybridsim.engine.record.trajectory import Trajectory
from hybridsim.engine.run.stepping import Flow
from hybridsim.engine.system.system import System
from hybridsim.model.checks.denominators import Denominator, denominators

_LOOKS = 64  # states of a run that are checked; a denominator rarely crosses zero twice between two of them
_HALVINGS = 60
# The rates are evaluated at this distance from the zero, in steps and at least in ulps of time, and again at
# r times that distance (r = _PART). Over it continuous rates change by a factor r, a root by sqrt(r), and a
# jump or a pole by 1 or more. The slope of a root grows by 1/sqrt(r), that of a pole by 1/r or more. The
# thresholds lie half way between.
_NEAR, _PART, _ULPS = 1e-2, 1e-2, 4.0
_ROUNDING = 1e-9  # of the rates: a smaller relative change is rounding
_REMEDY = "end the run earlier by a monitor, or change the rate so that its denominator stays away from zero"


class _Way:
    """The states during a run, and the signs of the denominators in its rates."""

    def __init__(self, system: System, segments: list[Segment]) -> None:
        model = system.model
        self.system, self.segments = system, segments
        self._names, self._parameters = [s.name for s in model.states], model.parameter_values()

    def sign(self, divisor: Denominator, number: int, s: float, x: np.ndarray) -> int:
        """Return the sign of a denominator at a local time of one segment."""
        t = float(self.segments[number].origin.plus(s))
        states = dict(zip(self._names, x.tolist(), strict=True))
        return divisor.sign({**self._parameters, "t": t, **states})

    def passage(self, divisor: Denominator) -> tuple[int, float, float] | None:
        """Return the first crossing of a pole by a denominator: segment, local time and step length."""
        stride = max(sum(len(segment.s) for segment in self.segments) // _LOOKS, 1)
        for number, segment in enumerate(self.segments):
            last = len(segment.s) - 1
            looks = sorted({*range(0, last, stride), last})
            signs = [self.sign(divisor, number, float(segment.s[k]), segment.x[k]) for k in looks]
            for i in range(len(looks) - 1):
                if signs[i] * signs[i + 1] < 0:
                    s, step = self._zero(divisor, number, looks[i], looks[i + 1])
                    if self._is_pole(segment, s, step):
                        return number, s, step
        return None

    def _zero(self, divisor: Denominator, number: int, first: int, last: int) -> tuple[float, float]:
        """Return the last time before a sign change between two steps, and the length of the step."""
        segment = self.segments[number]
        sign = self.sign(divisor, number, float(segment.s[first]), segment.x[first])
        while last - first > 1:
            middle = (first + last) // 2
            is_before = self.sign(divisor, number, float(segment.s[middle]), segment.x[middle]) == sign
            first, last = (middle, last) if is_before else (first, middle)
        before, after = float(segment.s[first]), float(segment.s[last])
        step = after - before
        for _ in range(_HALVINGS):
            s = 0.5 * (before + after)
            is_before = self.sign(divisor, number, s, segment.dense(np.array([s]))[0]) == sign
            before, after = (s, after) if is_before else (before, s)
        return before, step

    def _is_pole(self, segment: Segment, s: float, step: float) -> bool:
        """Return whether the rates are discontinuous or unbounded at a local time."""
        flow, low, high = Flow(self.system, segment.p, segment.z, Counters()), *sorted(segment.s[[0, -1]])
        nearest = max(_NEAR * _PART * abs(step), _ULPS * math.ulp(s))
        near = max(_NEAR * abs(step), 10.0 * nearest)
        changes, slopes, size = [], [], np.zeros(0)
        for length in (near, nearest):
            times = np.clip(np.array([s - length, s + length]), low, high)
            states = segment.dense(times)
            left, right = (flow.rhs(t, x) for t, x in zip(times.tolist(), states, strict=True))
            changes.append(np.abs(right - left))
            size = np.maximum(np.abs(left), np.abs(right))
            slopes.append(np.abs(flow.jacobian(float(times[1]), states[1])))
        part = nearest / near
        jumps = ~(changes[1] <= np.maximum(part**0.25 * changes[0], _ROUNDING * size))
        # 0/0 with a limit along this motion only: after it any motion may follow
        steep = ~(slopes[1] <= part**-0.75 * np.maximum(slopes[0], _ROUNDING * slopes[0].max(initial=0.0)))
        return bool(jumps.any() or steep.any())


def end_at_pole(system: System, trajectory: Trajectory) -> None:
    """End a run at a zero of a denominator, unless the rates are continuous there."""
    every = denominators(system.model)
    if not every or not trajectory.segments or system.n == 0:
        return
    way = _Way(system, list(trajectory.segments))
    passed = [(found, divisor) for divisor in every if (found := way.passage(divisor)) is not None]
    if not passed:
        return
    (number, s, _), divisor = min(
        passed, key=lambda one: (one[0][0], abs(one[0][1] - way.segments[one[0][0]].s[0]))
    )
    last = way.segments[number]
    inside = np.abs(last.s - last.s[0]) < abs(s - last.s[0])
    at = np.array([s])
    ended = Segment(
        last.origin,
        last.z,
        last.p,
        np.append(last.s[inside], at),
        np.append(last.x[inside], last.dense(at), 0),
        last.dense,
    )
    trajectory.segments.blocks = [SegmentList(system, [*way.segments[:number], ended])]
    forward = last.s[-1] >= last.s[0]
    before_pole = [o for o in trajectory.occurrences if (o.instant.minus(ended.end) <= 0.0) == forward]
    trajectory.occurrences.blocks = [OccurrenceList(before_pole)] if before_pole else []
    trajectory.forget_checkpoint()
    trajectory.status = "step-failure"
    trajectory.message = (
        f"after t = {float(ended.end):.9g}: the denominator {divisor.text} in the rate of {divisor.state} "
        f"passes zero. The rates have a pole or a jump there, so the motion cannot be continued: {_REMEDY}"
    )


def passed_unseen(system: System, trajectory: Trajectory, x0: np.ndarray, t0: float) -> list[str]:
    """Return warnings for denominators that changed sign in a run whose states were not saved."""
    every = denominators(system.model)
    if not every or not trajectory.segments or system.n == 0:
        return []
    way = _Way(system, list(trajectory.segments))
    first, last = way.segments[0], way.segments[-1]
    if float(first.start) == t0:
        return []
    start = Segment(first.origin, first.z, first.p, first.s[:1], x0[None], first.dense)
    begun = _Way(system, [start])
    return [
        f"the denominator {d.text} in the rate of {d.state} has different signs at the start and at the end: it may "
        f"have passed a pole, after which the results are meaningless. Use keep='all' to check, or {_REMEDY}"
        for d in every
        if begun.sign(d, 0, float(first.s[0]), x0)
        * way.sign(d, len(way.segments) - 1, float(last.s[-1]), last.x[-1])
        < 0
    ]
