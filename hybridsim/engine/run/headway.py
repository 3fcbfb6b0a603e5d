"""Whether a run comes forward: one that would take days ends by itself, and a stiff method takes over from another."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hybridsim.engine.system.failures import StepFailure
from hybridsim.engine.system.instant import Instant

if TYPE_CHECKING:
    from hybridsim.engine.record.counters import Counters
    from hybridsim.engine.run.segment_run import SegmentRun
    from hybridsim.engine.system.system import System

# Seconds of a step, roughly, in Python and in compiled code, and of an event. It is steps that are counted, so that a
# run ends at the same one on every machine.
_STEP, _COMPILED_STEP, _EVENT = 1e-4, 1e-6, 1e-5
_WINDOW = 0.5  # so long a run is looked at before it is judged, again and again
_WINDOWS = 3  # of these in a row with no better headway are no beginning
_BETTER = 2.0  # times as far in a window: it gets faster
_HOPELESS = 1e5  # seconds to go: a day
# Twice the cost leads no farther than the cost before, so many times in a row, give or take that much; and so many more
# times would have to lead to the end.
_TWICE, _FARTHER, _MORE = 3, 1.2, 20.0
_CRAWLING = 30.0  # seconds to go where a motion goes back and forth across a jump that nobody has declared
_LAST, _TURNS = 400, 0.2  # steps that are looked at then, and how many of them turn a rate round
_SOONER = 1.0  # seconds to go by an explicit method from which on a stiff one, a Python step at a time, is sooner there

_JUMP = (
    "the rates jump, and the steps at the jump are very short: declare the surface of the jump ([surfaces.NAME] "
    'expr = "..."), or a contact ([contacts.NAME]) for dry friction'
)
_EVENTS = "events follow each other too closely: declare a wider hysteresis, a switching surface or the limit of a mode"
_STEPS = (
    "use a stiff integrator (rodas5p) if the motion is slow and the steps are short; if the tolerance is too tight, "
    "declare `nominal` sizes or pass a larger atol or rtol; or pass a shorter t_span"
)

HEADWAY_SIZE, HEADWAY_PACE = (
    13,
    7,
)  # numbers to go on with, and which of them is infinite until a window is over


def cost(steps: float, compiled: float, events: float) -> float:
    """Seconds, roughly, of steps in Python, of steps in compiled code, and of events."""
    return steps * _STEP + compiled * _COMPILED_STEP + events * _EVENT


class NoHeadway(StepFailure):
    """At this pace the run would not come to its end; advice: what to declare or to set where nothing else is known."""

    def __init__(self, message: str, advice: str) -> None:
        super().__init__(message)
        self.advice = advice


class TakenOver(Exception):
    """From here on another method goes on."""


class Headway:
    """Watches one run, from its origin to its end."""

    def __init__(self, system: System, counters: Counters, origin: Instant, end: Instant) -> None:
        self.system, self.counters, self.end = system, counters, end
        # rates may jump inside a mode, as what is written with `sign` does where it is not understood
        self.may_jump = system.has_corners or not system.has_tape
        self._since, self._steps, self._events = origin, counters.steps, counters.events
        self._in_python = 0
        # time per second in the last window; windows in a row that were no better
        self._last, self._slow = math.inf, 0
        # the cost in all, and when it is twice as much; where it was half, how far that led, how often no farther
        self._cost, self._twice, self._half, self._led, self._fading = 0.0, _WINDOW, origin, 0.0, 0

    @property
    def place(self) -> np.ndarray:
        """What it knows, in an array, to go on with."""
        counts = self._steps, self._events, self._in_python, self._last, self._slow
        return np.array(
            [*self._since, *self._half, *counts, self._cost, self._twice, self._led, self._fading]
        )

    def go_on(self, place: np.ndarray) -> None:
        """Take up what was known."""
        high, low, half, rest, steps, events, in_python, last, slow, *cost, fading = place.tolist()
        self._since, self._half = Instant(high, low), Instant(half, rest)
        self._steps, self._events, self._in_python = int(steps), int(events), int(in_python)
        self._last, self._slow, self._fading = last, int(slow), int(fading)
        self._cost, self._twice, self._led = cost

    def step(self, now: Instant, run: SegmentRun) -> None:
        """A step was taken in Python."""
        self._in_python += 1
        if self._in_python * _STEP >= _WINDOW:
            self._judge(now, run)

    def leapt(self, now: Instant) -> None:
        """Steps were taken in compiled code."""
        if self._spent() >= _WINDOW:
            self._judge(now, None)

    def is_sooner(self, now: Instant, h: float, compiled: bool) -> bool:
        """Whether steps of length h to the end take longer than a stiff method."""
        return abs(self.end.minus(now)) * (_COMPILED_STEP if compiled else _STEP) > _SOONER * abs(h)

    def _spent(self) -> float:
        compiled = self.counters.steps - self._steps - self._in_python
        events = self.counters.events - self._events
        return cost(self._in_python, compiled, events)

    def _judge(self, now: Instant, run: SegmentRun | None) -> None:
        spent, before = self._spent(), self._since
        has_events = (self.counters.events - self._events) * _EVENT > 0.5 * spent
        pace, left = abs(now.minus(before)) / spent, abs(self.end.minus(now))
        self._slow = self._slow + 1 if pace <= _BETTER * self._last else 0
        self._since, self._last = now, pace
        self._steps, self._events, self._in_python = self.counters.steps, self.counters.events, 0
        to_go = left / pace if pace > 0.0 else math.inf
        crawls = run is not None and self.may_jump and goes_back_and_forth(run)
        is_slow = self._slow >= _WINDOWS - 1
        is_hopeless = is_slow and (to_go >= _HOPELESS or (crawls and to_go >= _CRAWLING))
        if self._fades(now, spent, left) or is_hopeless:
            advice = _JUMP if crawls else _EVENTS if has_events else _STEPS
            raise NoHeadway(
                f"no headway: the last interval led from t = {float(before):.9g} to {float(now):.9g}, and the rest of "
                f"the run would take at least {to_go / spent:.0e} times as much work",
                advice,
            )

    def _fades(self, now: Instant, spent: float, left: float) -> bool:
        """Whether each doubling of the cost leads no farther than the one before, and not to the end."""
        self._cost += spent
        if self._cost < self._twice:
            return False
        led = abs(now.minus(self._half))
        self._fading = self._fading + 1 if led <= _FARTHER * self._led else 0
        self._half, self._led, self._twice = now, led, 2.0 * self._cost
        return self._fading >= _TWICE and left > _MORE * led


def goes_back_and_forth(run: SegmentRun) -> bool:
    """Whether a state turns round at every few of the last steps of a segment."""
    states = np.array(run.states[-_LAST:])
    if len(states) < _LAST or not states.size:
        return False
    moves = np.diff(states, axis=0)
    turns = (moves[1:] * moves[:-1] < 0.0).mean(axis=0)
    return bool((turns >= _TURNS).any())
