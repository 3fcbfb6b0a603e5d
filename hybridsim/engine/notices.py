"""What a run is told beside its result: accumulation, chattering, steps kept short by stability.

Looked for in what the run leaves behind, every few hundred events or steps and at its end; it never changes the run.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from hybridsim.engine.jets import UNIT
from hybridsim.engine.pieces import Occurrence, Segment
from hybridsim.engine.stepping import Method
from hybridsim.engine.system import System
from hybridsim.engine.trajectory import Task, Trajectory

# Chattering: so many events in a row, between two of which no state moves by more than this share of its range so far.
_EVENTS, _SHARE = 200, 1e-3
_FASTER = 0.5  # intervals that shrink by more over these events accumulate, which is another matter
# Stiff: of the steps looked at so many are longer than this share of what stability allows along the negative axis.
_STEPS, _LOOKS, _MOST, _NEAR = 500, 8, 6, 0.6
_ITERATIONS, _ALIGNED = 12, 0.9  # of the power method, and how well its vector must have settled on a decay


class Notices:
    """Watches one run.

    A stiffness is found as in the code DOP853 (Hairer, Norsett and Wanner 1996, section IV.2), by h |lambda| against
    the border of the stability region; lambda, the fastest rate, by the power method on differences of the flow.
    """

    def __init__(self, system: System, method: Method, task: Task, record: Trajectory) -> None:
        self.system, self.method, self.tolerances, self.record = system, method, task.tolerances, record
        self._events = self._steps = 0  # at the last look
        self._lowest = self._highest = task.x0
        self._done: set[str] = set()

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
            self._look_for_stiffness(_sampled(self.record.segments.blocks[-1]))

    # -- chattering -----------------------------------------------------------------------------------------

    def _look_for_chattering(self) -> None:
        last = [o for o in _last(self.record.occurrences.blocks, _EVENTS) if o.kind == "transition"]
        if not last:
            return
        states = np.array([o.x_minus for o in last])
        self._lowest = np.minimum(self._lowest, states.min(axis=0))
        self._highest = np.maximum(self._highest, states.max(axis=0))
        if len(last) < _EVENTS or "chattering" in self._done:
            return
        times = np.array([float(o.instant.minus(last[0].instant)) for o in last])
        turns = max(map(abs, self.system.rates), default=0.0) * abs(times[-1]) / (2.0 * math.pi)
        moved = np.abs(states[1:] - np.array([o.x_plus for o in last])[:-1]).max(axis=0, initial=0.0)
        quarter = _EVENTS // 4
        first, end = abs(times[quarter]), abs(times[-1] - times[-1 - quarter])
        if (
            (moved <= _SHARE * (self._highest - self._lowest)).all()
            and turns < 1.0
            and end >= _FASTER * first
        ):
            self._done.add("chattering")
            (name, count), *_ = Counter(o.component for o in last).most_common(1)
            self.record.warn(
                f"chattering: {count} of {_EVENTS} events within {abs(times[-1]):.3g} from t = "
                f"{float(last[0].instant):.9g} on are of {name}, and between two of them nothing moves by more than "
                f"{_SHARE:g} of its range: declare a switching surface, or a wider hysteresis"
            )

    # -- stiffness ------------------------------------------------------------------------------------------

    def _look_for_stiffness(self, samples: list[tuple[Segment, int]]) -> None:
        if "stiff" in self._done or len(samples) < _LOOKS:
            return
        lengths = [
            abs(segment.s[k + 1] - segment.s[k]) * self._fastest_decay(segment, k) for segment, k in samples
        ]
        if sum(length >= _NEAR * self.method.stable_to for length in lengths) >= _MOST:
            self._done.add("stiff")
            longest = int(np.argmax(lengths))
            segment, k = samples[longest]
            t, h = float(segment.origin.plus(float(segment.s[k]))), abs(segment.s[k + 1] - segment.s[k])
            self.record.warn(
                f"stiff: at t = {t:.9g} a decay within {h / lengths[longest]:.3g} is long over and keeps the steps at "
                f"{h:.3g} by stability, not accuracy: rodas5p, cvode-bdf and scipy-radau take longer ones"
            )

    def _fastest_decay(self, segment: Segment, k: int) -> float:
        """The largest rate of the flow at a step's start if it is that of a decay, else 0."""
        system, s, x = self.system, float(segment.s[k]), segment.x[k]
        sizes = np.abs(x) + self.tolerances.atol / self.tolerances.rtol
        sizes = np.where(sizes > 0.0, sizes, 1.0)
        here = system.flow(s, x, segment.p, segment.z)
        v, rate, aligned = here / sizes, 0.0, 0.0
        for _ in range(_ITERATIONS):
            size = float(np.linalg.norm(v))
            if not 0.0 < size < math.inf:
                return 0.0
            v = v / size
            step = math.sqrt(UNIT)
            image = (system.flow(s, x + step * sizes * v, segment.p, segment.z) - here) / (step * sizes)
            rate, aligned = float(np.linalg.norm(image)), float(image @ v)
            v = image
        return rate if aligned <= -_ALIGNED * rate else 0.0


def _last(blocks: Sequence[Any], count: int) -> list[Occurrence]:
    """So many of the last occurrences, or all that there are."""
    found: list[Occurrence] = []
    for block in reversed(blocks):
        first = max(0, len(block) - (count - len(found)))
        found = [block[i] for i in range(first, len(block))] + found
        if len(found) == count:
            break
    return found


def _sampled(block: Any) -> list[tuple[Segment, int]]:
    """Some steps that no event cut short, evenly among the segments of a block."""
    size = len(block)
    chosen = np.unique(np.linspace(0, size - 1, min(size, _LOOKS)).astype(int)).tolist()
    share = -(-_LOOKS // len(chosen))
    found: list[tuple[Segment, int]] = []
    for i in chosen:
        segment: Segment = block[i]
        whole = len(segment.s) - 2  # steps but for the last
        if whole > 0:
            places = np.unique(np.linspace(0, whole - 1, min(whole, share)).astype(int))
            found += [(segment, k) for k in places.tolist()]
    return found[:_LOOKS]
