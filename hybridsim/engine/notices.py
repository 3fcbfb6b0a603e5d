"""What a run is told beside its result: accumulation, chattering, steps kept short by stability.

Looked for in what the run leaves behind, every few hundred events or steps and at its end; it never changes the run.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from hybridsim.engine.jets import UNIT
from hybridsim.engine.jit import call, kernel
from hybridsim.engine.pieces import Occurrence
from hybridsim.engine.stepping import Method
from hybridsim.engine.system import System
from hybridsim.engine.timepair import Instant
from hybridsim.engine.trajectory import Task, Trajectory

# Chattering: so many events in a row, between two of which no state moves by more than this share of its range so far.
_EVENTS, _SHARE = 200, 1e-3
_FASTER = 0.5  # intervals that shrink by more over these events accumulate, which is another matter
# Stiff: of the steps looked at so many are longer than this share of what stability allows along the negative axis.
_STEPS, _LOOKS, _MOST, _NEAR = 500, 8, 6, 0.6
_ITERATIONS, _ALIGNED = 12, 0.9  # of the power method, and how well its vector must have settled on a decay


@kernel
def moves_little(states: Any, share: float, extent: Any) -> bool:
    """Whether no state moves by more than a share of its range from one event to the next.

    states (k, 2, n): before and after each event. extent (2, n): the range so far, least and largest, which takes in
    that before each event.
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
    """Watches one run.

    A stiffness is found as in the code DOP853 (Hairer, Norsett and Wanner 1996, section IV.2), by h |lambda| against
    the border of the stability region; lambda, the fastest rate, by the power method on differences of the flow.
    """

    def __init__(self, system: System, method: Method, task: Task, record: Trajectory) -> None:
        self.system, self.method, self.tolerances, self.record = system, method, task.tolerances, record
        self._events = self._steps = 0  # at the last look
        self._start = task.x0
        self._done: set[str] = set()

    @cached_property
    def _range(self) -> np.ndarray:
        """Least and largest states (2, n) so far."""
        return np.array([self._start, self._start])

    def accumulated(self, names: list[str]) -> None:
        """Events that follow each other ever faster were replaced by their limit."""
        self.record.warn(f"accumulation: events of {', '.join(names)} follow each other ever faster; what holds at "
                         f"their limit goes on from there")  # fmt: skip

    def look(self) -> None:
        """Look at what has come since the last time, if it is enough."""
        counters = self.record.counters
        if counters.events - self._events >= _EVENTS:
            self._events = counters.events
            self._look_for_chattering()
        if self.method.stable_to and counters.steps - self._steps >= _STEPS and self.record.segments:
            self._steps = counters.steps
            self._look_for_stiffness(self.record.segments.blocks[-1])

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
                f"chattering: {count} of {_EVENTS} events within {abs(times[-1]):.3g} from t = "
                f"{float(last[0].instant):.9g} on are of {name}, and between two of them nothing moves by more than "
                f"{_SHARE:g} of its range: declare a switching surface, or a wider hysteresis"
            )

    # -- stiffness ------------------------------------------------------------------------------------------

    def _look_for_stiffness(self, block: Any) -> None:
        if "stiff" in self._done:
            return
        samples = _sampled(block)
        if len(samples) < _LOOKS:
            return
        system, floors = self.system, self.tolerances.atol / self.tolerances.rtol
        flow, work = system.address("flow"), np.empty((5, system.n))
        lengths = [abs(h) * fastest_decay(flow, s, x, p, z, floors, work) for _, s, h, x, p, z in samples]
        if sum(length >= _NEAR * self.method.stable_to for length in lengths) >= _MOST:
            self._done.add("stiff")
            longest = int(np.argmax(lengths))
            i, s, h, *_ = samples[longest]
            t, h = float(Instant(*block.origins[i].tolist()).plus(s)), abs(h)
            self.record.warn(
                f"stiff: at t = {t:.9g} a decay within {h / lengths[longest]:.3g} is long over and keeps the steps at "
                f"{h:.3g} by stability, not accuracy: rodas5p, cvode-bdf and scipy-radau take longer ones"
            )


@kernel
def fastest_decay(flow: Any, s: float, x: Any, p: Any, z: Any, floors: Any, work: Any) -> float:
    """The largest rate of the flow at a state if it is that of a decay, else 0, by the power method on differences.

    floors (n,): sizes of states that are none; work (5, n) is written to.
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
    return rate if aligned <= -_ALIGNED * rate else 0.0


def _last_transitions(blocks: Sequence[Any], count: int) -> tuple[np.ndarray, np.ndarray]:
    """Instants (k, 2) and states on both sides (k, 2, n) of those that are transitions among so many of the last."""
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
    """So many of the last occurrences, or all that there are."""
    found: list[Occurrence] = []
    for block in reversed(blocks):
        first = max(0, len(block) - (count - len(found)))
        found = [block[i] for i in range(first, len(block))] + found
        if len(found) == count:
            break
    return found


def _sampled(block: Any) -> list[tuple[int, float, float, np.ndarray, np.ndarray, np.ndarray]]:
    """Some steps that no event cut short, evenly among the segments of a block.

    Of each the number of the segment, its local time and length, the state there, run-time vector and modes.
    """
    chosen = _evenly(len(block), _LOOKS)
    share = -(-_LOOKS // len(chosen))
    found: list[tuple[int, float, float, np.ndarray, np.ndarray, np.ndarray]] = []
    for i in chosen:
        knots, states, p, z = block.steps_of(i)
        for k in _evenly(len(knots) - 2, share):  # steps but for the last
            s, end = float(knots[k]), float(knots[k + 1])
            found.append((i, s, end - s, np.ascontiguousarray(states[k]), p, z))
    return found[:_LOOKS]


def _evenly(count: int, most: int) -> list[int]:
    """So many numbers below a count at most, from the first to the last one."""
    if count <= most:
        return list(range(count))
    return [k * (count - 1) // (most - 1) for k in range(most)] if most > 1 else [0]
