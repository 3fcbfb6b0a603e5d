"""Warn of accumulating events, of chattering, and of steps that are limited by stability.

They are derived from the record every few hundred events or steps and at the end. They never change the run.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import call, kernel
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.segments import Occurrence
from hybridsim.engine.record.trajectory import Task, Trajectory
from hybridsim.engine.run.headway import Headway, cost, cost_of_restarts
from hybridsim.engine.run.method_kernels import STEPS_PER_LOOK
from hybridsim.engine.run.segment_run import SegmentRun
from hybridsim.engine.run.stepping import Flow, Method
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System

# Chattering: this many consecutive events, between which no state moves by more than this fraction of its range.
_EVENTS, _SHARE = 200, 1e-3
_FASTER = 0.5  # intervals that shrink by more over these events are an accumulation instead
# Stiffness: number of examined steps, how many must be near the stability limit, and the fraction that counts as near.
_LOOKS, _MIN_NEAR_LIMIT, _NEAR = 8, 6, 0.6
_DECAYING = 0.25  # least ratio of the decay rate to the magnitude of an eigenvalue
_ITERATIONS, _ALIGNED = 12, 0.9  # of the power method, and the required alignment of its vector with a decay

# A step: number of its segment, local time, length, state at its start, run-time vector and modes.
Sample = tuple[int, float, float, np.ndarray, np.ndarray, np.ndarray]


@kernel
def moves_little(states: Any, share: float, extent: Any) -> bool:
    """Return whether no state moves by more than the fraction `share` of its range between two events.

    states (k, 2, n): before and after each event. extent (2, n): least and largest states so far, which this function
    extends.
    """
    count, _, n = states.shape
    still = True
    for i in range(n):
        low, high, moved = extent[0, i], extent[1, i], 0.0
        for k in range(count):
            x = states[k, 0, i]
            low, high = min(low, x), max(high, x)
            if k > 0:
                moved = max(moved, abs(x - states[k - 1, 1, i]))
        extent[0, i], extent[1, i] = low, high
        still = still and moved <= share * (high - low)
    return still


class Notices:
    """Monitors one run, and collects its warnings.

    Stiffness is detected as in the code DOP853 (Hairer, Norsett and Wanner 1996, section IV.2), by comparing h |lambda|
    with the border of the stability region. The power method on differences of the flow gives lambda, the fastest rate.
    """

    def __init__(
        self,
        system: System,
        method: Method,
        task: Task,
        record: Trajectory,
        headway: Headway | None,
        is_compiled: bool,
    ) -> None:
        self.system, self.method, self.tolerances, self.record = system, method, task.tolerances, record
        self._events = self._steps = 0  # counts at the last examination
        # None unless a stiff method may take over
        self._headway, self._is_compiled, self.takes_over = headway, is_compiled, False
        self._start = task.x0
        self._done: set[str] = set()

    @cached_property
    def _range(self) -> np.ndarray:
        """Return the least and the greatest value of each state so far, as an array (2, n)."""
        return np.array([self._start, self._start])

    def accumulated(self, names: list[str]) -> None:
        """Warn that the events of some components accumulate, and that the run continues from their limit."""
        self.record.warn(f"accumulation: events of {', '.join(names)} follow each other ever faster; the run "
                         f"continues from their limit")  # fmt: skip

    def look(self) -> None:
        """Examine the new events and steps for warnings, if there are enough of them."""
        counters = self.record.counters
        if counters.events - self._events >= _EVENTS:
            self._events = counters.events
            self._look_for_chattering()
        if self.method.stable_to and counters.steps - self._steps >= STEPS_PER_LOOK and self.record.segments:
            self._steps = counters.steps
            block = self.record.segments.blocks[-1]
            self._look_for_stiffness(_sampled(block), lambda i: Instant(*block.origins[i].tolist()))

    def look_on_the_way(self, run: SegmentRun) -> bool:
        """Examine the steps of an unfinished segment; return whether a stiff method takes over."""
        counters = self.record.counters
        if (
            not self.method.stable_to
            or counters.steps - self._steps < STEPS_PER_LOOK
            or len(run.knots) <= STEPS_PER_LOOK
        ):
            return False
        self._steps, first = counters.steps, len(run.knots) - STEPS_PER_LOOK
        samples = [
            (0, run.knots[k], run.knots[k + 1] - run.knots[k], run.states[k], run.flow.p, run.flow.z)
            for k in (first + number for number in _evenly(STEPS_PER_LOOK - 1, _LOOKS))
        ]
        self._look_for_stiffness(samples, lambda _: run.origin)
        return self.takes_over

    # -- chattering -----------------------------------------------------------------------------------------

    def _look_for_chattering(self) -> None:
        instants, states = _last_transitions(self.record.occurrences.blocks, _EVENTS)
        if not len(instants):
            return
        is_still = moves_little(states, _SHARE, self._range)
        if not is_still or len(instants) < _EVENTS or "chattering" in self._done:
            return
        times = (instants - instants[0]).sum(axis=1)
        turns = self.system.fastest * abs(times[-1]) / (2.0 * math.pi)
        quarter = _EVENTS // 4
        first, end = abs(times[quarter]), abs(times[-1] - times[-1 - quarter])
        if turns < 1.0 and end >= _FASTER * first:
            self._done.add("chattering")
            last = _last(self.record.occurrences.blocks, _EVENTS)
            (name, count), *_ = Counter(o.component for o in last).most_common(1)
            self.record.warn(
                f"chattering: from t = {float(last[0].instant):.9g}, {count} of {_EVENTS} events within "
                f"{abs(times[-1]):.3g} time units belong to {name}, and no state moves by more than {_SHARE:g} of its "
                "range between two of these events. Declare a switching surface or a wider hysteresis."
            )

    # -- stiffness ------------------------------------------------------------------------------------------

    def _look_for_stiffness(self, samples: list[Sample], origin_of: Callable[[int], Instant]) -> None:
        if "stiff" in self._done or len(samples) < _LOOKS:
            return
        system, floors = self.system, self.tolerances.atol / self.tolerances.rtol
        flow, work = system.address("flow"), np.empty((5, system.n))
        lengths = []
        for _, s, h, x, p, z in samples:
            rate = fastest_decay(flow, s, x, p, z, floors, work)
            if rate < 0.0 and abs(h * rate) >= _NEAR * self.method.stable_to:
                rate = self._fastest_turning(s, x, p, z)
            lengths.append(abs(h) * max(rate, 0.0))
        if sum(length >= _NEAR * self.method.stable_to for length in lengths) < _MIN_NEAR_LIMIT:
            return
        longest = int(np.argmax(lengths))
        i, s, h, *_ = samples[longest]
        h = abs(h)
        now = origin_of(i).plus(s)
        if self._headway is not None and self._headway.is_sooner(now, h, self._is_compiled):
            self.takes_over = True
            return
        self._done.add("stiff")
        explicit = cost(0.0, 1.0 / h, 0.0) if self._is_compiled else cost(1.0 / h, 0.0, 0.0)
        if explicit < cost_of_restarts(system, 1.0):
            advice = "Implicit methods restart at each clock tick, so they are probably not faster."
        else:
            advice = "rodas5p, cvode-bdf or scipy-radau will be faster."
        self.record.warn(
            f"stiff: at t = {float(now):.9g} stability, not accuracy, limits the step to {h:.3g} (time constant "
            f"{h / lengths[longest]:.3g}). {advice}"
        )

    def _fastest_turning(self, s: float, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> float:
        """Return the largest |lambda| of decaying eigenvalues, including complex pairs, from the Jacobian."""
        jacobian = Flow(self.system, p, z, Counters()).jacobian(s, x)
        if not np.isfinite(jacobian).all():
            return 0.0
        values = np.linalg.eigvals(jacobian)
        decays = np.abs(values)[values.real <= -_DECAYING * np.abs(values)]
        return float(decays.max(initial=0.0))


@kernel
def fastest_decay(flow: Any, s: float, x: Any, p: Any, z: Any, floors: Any, work: Any) -> float:
    """Return the fastest decay rate of the flow at a state, or a negative number if there is none.

    The power method on differences of the flow is used. floors (n,): sizes for states that are zero. work (5, n):
    scratch.
    """
    here, sizes, v, moved, image = work[0], work[1], work[2], work[3], work[4]
    call(flow, s, x, p, z, here)
    for i in range(x.shape[0]):
        sizes[i] = abs(x[i]) + floors[i]
        if not sizes[i] > 0.0:
            sizes[i] = 1.0
        v[i] = here[i] / sizes[i]
    rate = aligned = 0.0
    step = math.sqrt(UNIT)
    for _ in range(_ITERATIONS):
        size = 0.0
        for i in range(x.shape[0]):
            size += v[i] * v[i]
        size = math.sqrt(size)
        if not 0.0 < size < math.inf:
            return 0.0
        for i in range(x.shape[0]):
            v[i] /= size
            moved[i] = x[i] + step * sizes[i] * v[i]
        call(flow, s, moved, p, z, image)
        rate = aligned = 0.0
        for i in range(x.shape[0]):
            image[i] = (image[i] - here[i]) / (step * sizes[i])
            rate += image[i] * image[i]
            aligned += image[i] * v[i]
        rate = math.sqrt(rate)
        for i in range(x.shape[0]):
            v[i] = image[i]
    return rate if aligned <= -_ALIGNED * rate else -rate


def _last_transitions(blocks: Sequence[Any], count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the instants (k, 2) and the states (k, 2, n) before and after each of the last transitions."""
    parts, missing = [], count
    for block in reversed(blocks):
        first = max(0, len(block) - missing)
        parts.append(block.transitions(first))
        missing -= len(block) - first
        if missing <= 0:
            break
    if len(parts) == 1:
        return parts[0]
    filled = [part for part in reversed(parts) if len(part[0])]
    if not filled:
        return np.empty((0, 2)), np.empty((0, 2, 0))
    instants, states = zip(*filled, strict=True)
    return np.concatenate(instants), np.concatenate(states)


def _last(blocks: Sequence[Any], count: int) -> list[Occurrence]:
    """Return the last `count` events, or all events if there are fewer."""
    found: list[Occurrence] = []
    for block in reversed(blocks):
        first = max(0, len(block) - (count - len(found)))
        found = [block[i] for i in range(first, len(block))] + found
        if len(found) == count:
            break
    return found


def _sampled(block: Any) -> list[Sample]:
    """Return sampled steps of evenly spaced segments; last steps of segments are not sampled."""
    chosen = _evenly(len(block), _LOOKS)
    share = -(-_LOOKS // len(chosen))
    found: list[Sample] = []
    for i in chosen:
        knots, states, p, z = block.steps_of(i)
        among = _evenly(len(knots) - 2, share + 2)  # an event shortens the last step, and a restart the first
        for k in among[1:-1] if len(among) == share + 2 else among[:share]:
            s, end = float(knots[k]), float(knots[k + 1])
            found.append((i, s, end - s, np.ascontiguousarray(states[k]), p, z))
    return found[:_LOOKS]


def _evenly(count: int, most: int) -> list[int]:
    """Return at most `most` whole numbers below `count`, evenly spaced from 0 to `count` - 1."""
    if count <= most:
        return list(range(count))
    return [k * (count - 1) // (most - 1) for k in range(most)] if most > 1 else [0]
