"""This module controls the step size of one-step methods with an error estimate."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from hybridsim.engine.native.time_grid import on_the_grid
from hybridsim.engine.record.segments import Dense
from hybridsim.engine.record.trajectory import PiecewiseDense
from hybridsim.engine.run.stepping import Flow, Step
from hybridsim.engine.system.failures import Collapsed, StepFailure
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.integrators.step_control import LAST_STEP_FACTOR, SMALLEST, next_length

_MAX_PARTS = 64  # most parts of a step that is repeated up to an event
_SHORTER = 0.5  # factor on a step whose error up to an event is above the tolerance


class Point:
    """A state during the run, with further quantities computed on first use."""

    def __init__(self, flow: Flow, s: float, x: np.ndarray) -> None:
        self.flow, self.s, self.x = flow, s, x

    @cached_property
    def dx(self) -> np.ndarray:
        """Return the rates (n,) of the states."""
        self.flow.counters.rhs_evaluations += 1
        return self.flow.rhs(self.s, self.x)

    @cached_property
    def series(self) -> np.ndarray:
        """Return the Taylor coefficients of the flow up to third order (n, 4)."""
        flow, zero = self.flow, np.zeros(self.flow.n)
        return flow.system.series(self.s, self.x, flow.p, flow.z, zero, 0.0).states


@dataclass(frozen=True)
class Trial:
    """The end of a trial step: the state, the scaled error, and the method's data for dense output."""

    x: np.ndarray
    error: float
    dense_data: Any = None


class OneStepStepper(ABC):
    """Advances a one-step method through one segment.

    Parameters
    ----------
    order : order of the method.
    error_order : exponent of the step size in the error estimate.
    """

    def __init__(
        self,
        flow: Flow,
        x0: np.ndarray,
        bound: float,
        tolerances: Tolerances,
        first_step: float | None,
        order: int,
        error_order: int,
    ) -> None:
        self.flow, self.bound, self.tolerances = flow, bound, tolerances
        self.order, self.error_order = order, error_order
        self.control = (tolerances.rtol, tolerances.atol)
        self._memory = np.zeros(3)  # state of the step control
        self.here = self._point(0.0, x0)
        if not np.isfinite(self.here.dx).all():
            names = [n for n, d in zip(flow.system.names, self.here.dx, strict=True) if not np.isfinite(d)]
            raise StepFailure(f"the rate of {', '.join(names)} is not a finite number")
        self.h = first_step or self._first_step()

    def _point(self, s: float, x: np.ndarray) -> Point:
        return Point(self.flow, s, x)

    @abstractmethod
    def attempt(self, start: Point, h: float) -> Trial:
        """Try one step of length `h`, which is negative for a run backward in time."""

    @abstractmethod
    def dense(self, start: Point, end: Point, trial: Trial) -> Dense:
        """Return the dense output of an accepted step."""

    def holds(self, start: Point, end: Point, trial: Trial) -> bool:
        """Return whether the dense output is accurate inside the step."""
        return True

    def step(self) -> Step:
        """Take steps until a step is accepted, and return this step."""
        direction, start = math.copysign(1.0, self.bound), self.here
        while True:
            h = min(self.h, self.tolerances.max_step)
            # the rest would be too short for another step
            last = h * LAST_STEP_FACTOR >= abs(self.bound - start.s) - SMALLEST * math.ulp(self.bound)
            h = abs(self.bound - start.s) if last else abs(on_the_grid(start.s, direction * h))
            if not h > 0.0:
                raise Collapsed(f"the step size fell to {h:.3g}")
            trial = self.attempt(start, direction * h)
            self.h = next_length(h, trial.error, self.error_order, self._memory)
            if trial.error <= 1.0:
                s = self.bound if last else start.s + direction * h
                end = self._point(s, self.flow.landed(s, trial.x))
                if self.holds(start, end, trial):
                    break
                self.h = _SHORTER * h
            self.flow.counters.rejected += 1
            if last and h <= SMALLEST * math.ulp(self.bound):  # a repetition would have the same length
                raise Collapsed(f"the step size fell to {h:.3g}")
        self.here = end
        return Step(start.s, s, start.x, end.x, self.dense(start, end, trial))

    def restep(self, step: Step, s: float) -> Step:
        """Repeat a step to exactly the local time `s`, or return a shorter step if the result is inaccurate.

        A law may be steep at an event and flat on both sides, which the stages of the longer step missed. If
        the change of the state is below the tolerance, equal parts are used, because a law with a jump cannot
        be resolved further.
        """
        start, length = self._point(step.s0, step.x0), s - step.s0
        trial = self.attempt(start, length)
        if trial.error <= 1.0:
            end = self._point(s, trial.x)
            return Step(step.s0, s, step.x0, trial.x, self.dense(start, end, trial))
        self.flow.counters.rejected += 1
        rtol, atol = self.control
        moves = np.abs(step.dense(np.array([s]))[0] - step.x0)
        if (moves > atol + rtol * np.abs(step.x0)).any():
            self.here, self.h = start, _SHORTER * abs(length)
            return self.step()
        return self._in_parts(start, s)

    def _in_parts(self, start: Point, s: float) -> Step:
        """Return a step up to the local time `s`, taken in as many equal parts as the error requires."""
        count = 2
        while True:
            knots = np.linspace(start.s, s, count + 1)
            points, trials = [start], []
            for a, b in pairwise(knots.tolist()):
                trials.append(self.attempt(points[-1], b - a))
                points.append(self._point(b, trials[-1].x))
            if count == _MAX_PARTS or all(trial.error <= 1.0 for trial in trials):
                break
            self.flow.counters.rejected += 1
            count *= 2
        parts = tuple(self.dense(a, b, trial) for (a, b), trial in zip(pairwise(points), trials, strict=True))
        return Step(start.s, s, start.x, points[-1].x, PiecewiseDense(knots, parts))

    def _first_step(self) -> float:
        """Return the starting step by the method of Hairer, Norsett and Wanner 1993, section II.4."""
        x, dx = self.here.x, self.here.dx
        scale = self.tolerances.atol + self.tolerances.rtol * np.abs(x)
        scale = np.where(scale > 0.0, scale, 1.0)

        def size(x: np.ndarray) -> float:
            with np.errstate(over="ignore"):  # an infinite norm gives the smallest step
                return float(np.sqrt(np.mean((x / scale) ** 2)))

        d0, d1 = size(x), size(dx)
        # a state that has just reached zero makes the estimate as small as its rounding; error control corrects it
        smallest = 1e-9 * abs(self.bound)
        h0 = 1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1
        if not h0 > 0.0:
            return smallest
        h0 = min(h0, abs(self.bound))
        direction = math.copysign(1.0, self.bound)
        ahead = Point(self.flow, direction * h0, x + direction * h0 * dx).dx
        steepest = max(d1, size(ahead - dx) / h0)
        h1 = (0.01 / steepest) ** (1.0 / self.order) if steepest > 1e-15 else max(1e-6, 1e-3 * h0)
        return max(min(100.0 * h0, h1, abs(self.bound)), smallest) if math.isfinite(h1) else smallest
