"""Stop runs that would take days, and switch to a stiff method if the stiff method is faster."""

from __future__ import annotations

import math

import numpy as np

from hybridsim.engine.record.counters import Counters
from hybridsim.engine.run.segment_run import SegmentRun
from hybridsim.engine.system.failures import StepFailure
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System
from hybridsim.expr import evaluate

# Approximate seconds for a step in Python, a step in compiled code, and an event. The cost is computed from counts, so
# that a run ends at the same step on every machine.
_STEP, _COMPILED_STEP, _EVENT = 1e-4, 1e-6, 1e-5
_STEPS_AFTER_TICK = 30  # approximate number of steps of a stiff method between clock ticks, where it restarts
_WINDOW = 0.5  # cost in seconds between judgements
_WINDOWS = 3  # consecutive windows without a better pace before a run counts as slow
_BETTER = 2.0  # ratio of paces that counts as an improvement
_HOPELESS = 1e5  # predicted seconds to the end after which a run is stopped: about a day
# Number of consecutive doublings of the cost without more progress, the tolerated ratio of progress, and the least
# number of further such intervals to the end.
_TWICE, _FARTHER, _MORE = 3, 1.2, 20.0
_CRAWLING = 30.0  # the same limit for a motion that alternates across an undeclared jump
_EXAMINED_STEPS = 400  # number of last steps that are examined for reversals
_REVERSAL_FRACTION = 0.2  # least fraction of them with a reversal
_SOONER = 1.0  # predicted seconds by an explicit method above which a stiff method in Python is faster

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
)  # length of `Headway.place`, and the index of the pace, infinite at first


def cost(steps: float, compiled: float, events: float) -> float:
    """Return an estimated time in seconds for numbers of Python steps, compiled steps and events."""
    return steps * _STEP + compiled * _COMPILED_STEP + events * _EVENT


def cost_of_restarts(system: System, duration: float) -> float:
    """Return the least time in seconds for a stiff method, which steps in Python and restarts at each clock tick."""
    values = system.values
    periods = [evaluate(s.period, values) for s in system.model.schedules if s.period is not None]
    return cost(_STEPS_AFTER_TICK * duration / min(periods), 0.0, 0.0) if periods else 0.0


class NoHeadway(StepFailure):
    """Raised if the run would not reach its end at its present speed; `advice` is the remedy to report."""

    def __init__(self, message: str, advice: str) -> None:
        super().__init__(message)
        self.advice = advice


class TakenOver(Exception):
    """Raised when another method continues the run from the present instant."""


class Headway:
    """Monitors how fast one run advances in time, from its start to its end."""

    def __init__(self, system: System, counters: Counters, origin: Instant, end: Instant) -> None:
        self.system, self.counters, self.end = system, counters, end
        # whether rates may jump inside a mode, for example by a `sign` that is not treated as a surface
        self.may_jump = system.has_corners or not system.has_tape
        self._since, self._steps, self._events = origin, counters.steps, counters.events
        self._in_python = 0
        # simulated time per second in the last window; consecutive windows without improvement
        self._last, self._slow = math.inf, 0
        # total cost, next doubling, instant of the last doubling, its progress, doublings without more progress
        self._cost, self._twice, self._half, self._led, self._fading = 0.0, _WINDOW, origin, 0.0, 0

    @property
    def place(self) -> tuple[float, ...]:
        """Return the measurements so far as numbers, for a checkpoint."""
        counts = self._steps, self._events, self._in_python, self._last, self._slow
        return *self._since, *self._half, *counts, self._cost, self._twice, self._led, self._fading

    def go_on(self, place: np.ndarray) -> None:
        """Restore the stored measurements from a checkpoint."""
        high, low, half, rest, steps, events, in_python, last, slow, *cost, fading = place.tolist()
        self._since, self._half = Instant(high, low), Instant(half, rest)
        self._steps, self._events, self._in_python = int(steps), int(events), int(in_python)
        self._last, self._slow, self._fading = last, int(slow), int(fading)
        self._cost, self._twice, self._led = cost

    def step(self, now: Instant, run: SegmentRun) -> None:
        """Count a step in Python, and check the progress after a fixed number of steps."""
        self._in_python += 1
        if self._in_python * _STEP >= _WINDOW:
            self._check_pace(now, run)

    def check_compiled(self, now: Instant) -> None:
        """Check whether a run in compiled code advances fast enough."""
        if self._spent() >= _WINDOW:
            self._check_pace(now, None)

    def is_sooner(self, now: Instant, h: float, compiled: bool) -> bool:
        """Return whether a stiff method is probably faster than steps of length `h` up to the end."""
        left = abs(self.end.minus(now))
        explicit = left / abs(h) * (_COMPILED_STEP if compiled else _STEP)
        return explicit > max(_SOONER, cost_of_restarts(self.system, left))

    def _spent(self) -> float:
        compiled = self.counters.steps - self._steps - self._in_python
        events = self.counters.events - self._events
        return cost(self._in_python, compiled, events)

    def _check_pace(self, now: Instant, run: SegmentRun | None) -> None:
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
                f"no progress: the last interval advanced only from t = {float(before):.9g} to {float(now):.9g}, "
                f"and the rest of the run would need at least {to_go / spent:.0e} times the work of this interval",
                advice,
            )

    def _fades(self, now: Instant, spent: float, left: float) -> bool:
        """Return whether a run far from its end advances hardly farther, although its cost doubled several times."""
        self._cost += spent
        if self._cost < self._twice:
            return False
        led = abs(now.minus(self._half))
        self._fading = self._fading + 1 if led <= _FARTHER * self._led else 0
        self._half, self._led, self._twice = now, led, 2.0 * self._cost
        return self._fading >= _TWICE and left > _MORE * led


def goes_back_and_forth(run: SegmentRun) -> bool:
    """Return whether a state reverses its direction in many of the last steps of a segment."""
    states = np.array(run.states[-_EXAMINED_STEPS:])
    if len(states) < _EXAMINED_STEPS or not states.size:
        return False
    moves = np.diff(states, axis=0)
    turns = (moves[1:] * moves[:-1] < 0.0).mean(axis=0)
    return bool((turns >= _REVERSAL_FRACTION).any())
