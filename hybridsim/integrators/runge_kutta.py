"""Explicit embedded Runge-Kutta methods from their tableau: a new method is a tableau and a name."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np

from hybridsim.engine.hermite import hermite
from hybridsim.engine.leaper import compile_leaps
from hybridsim.engine.rk_leaper import RungeKuttaLeaper
from hybridsim.engine.rk_step import SMALLEST, Tableau, attempt, next_length
from hybridsim.engine.stepping import Dense, Flow, Step, StepFailure, Stepper, Tolerances, Watch
from hybridsim.engine.system import System
from hybridsim.engine.trajectory import Pieces
from hybridsim.integrators.base import Integrator

__all__ = ["RungeKuttaIntegrator", "RungeKuttaStepper", "Tableau"]

_MOST_PARTS = 64  # of a step that is repeated up to an event


class RungeKuttaStepper:
    """Steps a method through one segment, with local extrapolation and dense output of degree 7.

    The dense output is the Hermite polynomial on the Taylor coefficients of the flow at both ends, with an
    error of h**8 x^(8)/(256 8!); event times are refined by repeating the step.
    """

    def __init__(
        self,
        tableau: Tableau,
        flow: Flow,
        x0: np.ndarray,
        bound: float,
        tolerances: Tolerances,
        first_step: float | None,
    ) -> None:
        self.tableau, self.flow, self.bound, self.tolerances = tableau, flow, bound, tolerances
        self._control = (tolerances.rtol, tolerances.atol)
        self._address = flow.system.address("flow")
        self._memory = np.zeros(3)  # of the step control
        self._slopes = np.empty((len(tableau.c), flow.n))
        self.s, self.x, self.dx = 0.0, x0, self._rhs(0.0, x0)
        if not np.isfinite(self.dx).all():
            names = [n for n, d in zip(flow.system.names, self.dx, strict=True) if not np.isfinite(d)]
            raise StepFailure(f"the derivative of {', '.join(names)} is not a finite number")
        self.h = first_step or self._first_step()
        self.left = self._series(0.0, x0)

    def step(self) -> Step:
        """The next accepted step."""
        direction = math.copysign(1.0, self.bound)
        while True:
            h = min(self.h, self.tolerances.max_step)
            # what would be left is too short for a step of its own
            last = h >= abs(self.bound - self.s) - SMALLEST * math.ulp(self.bound)
            h = abs(self.bound - self.s) if last else h
            if not h >= SMALLEST * math.ulp(self.s):
                raise StepFailure(f"the step fell to {h:.3g} at local time {self.s!r}")
            x, error = self._attempt(self.s, self.x, self.dx, direction * h)
            if error <= 1.0:
                break
            self.flow.counters.rejected += 1
            self.h = next_length(h, error, self.tableau.error_order, self._memory)
        self.h = next_length(h, error, self.tableau.error_order, self._memory)
        s0, x0, left = self.s, self.x, self.left
        self.s, self.x = self.bound if last else s0 + direction * h, x
        self.dx, self.left = self._rhs(self.s, x), self._series(self.s, x)
        return Step(s0, self.s, x0, x, hermite(s0, self.s, left, self.left))

    def restep(self, step: Step, s: float) -> Step:
        """The step up to s in one step of exactly that length; in equal parts where its error asks for them."""
        count = 1
        while True:
            knots, states = np.linspace(step.s0, s, count + 1), [step.x0]
            good = True
            for a, b in pairwise(knots):
                x, error = self._attempt(float(a), states[-1], self._rhs(float(a), states[-1]), float(b - a))
                states.append(x)
                good = good and error <= 1.0
            if good or count == _MOST_PARTS:
                break
            self.flow.counters.rejected += 1
            count *= 2
        parts = tuple(
            self._dense(float(a), float(b), x0, x1)
            for (a, b), (x0, x1) in zip(pairwise(knots), pairwise(states), strict=True)
        )
        return Step(step.s0, s, step.x0, states[-1], parts[0] if count == 1 else Pieces(knots, parts))

    def _dense(self, s0: float, s1: float, x0: np.ndarray, x1: np.ndarray) -> Dense:
        made: list[Dense] = []

        def dense(s: np.ndarray) -> np.ndarray:
            if not made:
                made.append(hermite(s0, s1, self._series(s0, x0), self._series(s1, x1)))
            return made[0](s)

        return dense

    def _attempt(self, s: float, x: np.ndarray, dx: np.ndarray, h: float) -> tuple[np.ndarray, float]:
        flow, out = self.flow, np.empty(self.flow.n)
        flow.counters.rhs_evaluations += len(self.tableau.c) - 1
        error = attempt(
            self._address, self.tableau.arrays, s, h, x, dx, flow.p, flow.z, self._control, self._slopes, out
        )
        return out, error

    def _rhs(self, s: float, x: np.ndarray) -> np.ndarray:
        self.flow.counters.rhs_evaluations += 1
        return self.flow.rhs(s, x)

    def _series(self, s: float, x: np.ndarray) -> np.ndarray:
        zero = np.zeros(self.flow.n)
        return self.flow.system.series(s, x, self.flow.p, self.flow.z, zero, 0.0).states

    def _first_step(self) -> float:
        """Starting step of Hairer, Norsett and Wanner 1993, section II.4."""
        scale = self.tolerances.atol + self.tolerances.rtol * np.abs(self.x)
        scale = np.where(scale > 0.0, scale, 1.0)

        def size(x: np.ndarray) -> float:
            return float(np.sqrt(np.mean((x / scale) ** 2)))

        d0, d1 = size(self.x), size(self.dx)
        h0 = 1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1
        h0 = min(h0, abs(self.bound))
        direction = math.copysign(1.0, self.bound)
        ahead = self._rhs(direction * h0, self.x + direction * h0 * self.dx)
        steepest = max(d1, size(ahead - self.dx) / h0)
        h1 = (0.01 / steepest) ** (1.0 / self.tableau.order) if steepest > 1e-15 else max(1e-6, 1e-3 * h0)
        # a state that has just come to zero makes the estimate as small as its rounding; error control mends the rest
        smallest = 1e-9 * abs(self.bound)
        return max(min(100.0 * h0, h1, abs(self.bound)), smallest) if math.isfinite(h1) else smallest


@dataclass(frozen=True)
class RungeKuttaIntegrator(Integrator):
    """An explicit embedded method in compiled code; its class variables are a tableau and what describes it.

    Segments and ordinary events go through the compiled mode loop where nothing in the model speaks against it:
    corners inside a mode do, since it looks at guards through their series.
    """

    tableau: ClassVar[Tableau]
    lacks: ClassVar[dict[str, str]] = {"stiff": "explicit: its step is bound by the fastest rate"}
    leaps: ClassVar[bool] = True

    @classmethod
    def _leaper(cls, system: System, tolerances: Tolerances, longest: float) -> RungeKuttaLeaper:
        return RungeKuttaLeaper(system, tolerances, longest, cls.tableau)

    def prepare(self, system: System) -> None:
        """The compiled mode loop."""
        if not system.has_corners:
            compile_leaps(system, self._leaper)

    def leaper(self, system: System, tolerances: Tolerances, longest: float) -> RungeKuttaLeaper | None:
        """The compiled mode loop; None for a model with corners."""
        return None if system.has_corners else self._leaper(system, tolerances, longest)

    def start(
        self,
        flow: Flow,
        x0: np.ndarray,
        s_bound: float,
        tolerances: Tolerances,
        first_step: float | None,
        watch: Watch,
    ) -> Stepper:
        """Begin a smooth segment."""
        return RungeKuttaStepper(self.tableau, flow, x0, s_bound, tolerances, first_step)
