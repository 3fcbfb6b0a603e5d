"""Embedded Runge-Kutta methods from their tableau: a new method is a tableau and a name."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from hybridsim.engine.hermite import hermite
from hybridsim.engine.jit import call, kernel
from hybridsim.engine.stepping import Dense, Flow, Step, StepFailure, Tolerances
from hybridsim.engine.trajectory import Pieces

# Step control of Hairer, Norsett and Wanner 1993, section II.4: safety factor and bounds of the change of a step.
_SAFETY, _SHRINK, _GROW = 0.9, 0.2, 10.0
_MOST_PARTS = 64  # of a step that is repeated up to an event
_SMALLEST = 10.0  # a step of fewer ulps of the local time makes no progress


@dataclass(frozen=True)
class Tableau:
    """An explicit method with s stages: nodes c (s,), a (s, s) strictly lower triangular, weights b (s,).

    e (s,) is b minus the weights of the embedded method; the error estimate of a step then falls like
    h**error_order. e_low, where given, is a second estimate of lower order that keeps the first one honest, as in
    DOP853: the error used is e**2/sqrt(e**2 + 0.01 e_low**2).
    """

    c: np.ndarray
    a: np.ndarray
    b: np.ndarray
    e: np.ndarray
    order: int
    error_order: int
    e_low: np.ndarray = field(default_factory=lambda: np.zeros(0))


@kernel
def _try(
    flow: Any,
    tableau: Any,
    s: float,
    h: float,
    x: Any,
    dx: Any,
    p: Any,
    z: Any,
    tolerances: Any,
    k: Any,
    out: Any,
) -> float:
    """One step of length h from (s, x) with slope dx there; its end in `out`, its error in units of the tolerance.

    tableau: c, a, b, e, e_low. tolerances: rtol, atol.
    """
    c, a, b, e, e_low = tableau
    rtol, atol = tolerances
    stages, n = c.shape[0], x.shape[0]
    k[0] = dx
    for i in range(1, stages):
        for m in range(n):
            total = 0.0
            for j in range(i):
                total += a[i, j] * k[j, m]
            out[m] = x[m] + h * total
        call(flow, s + c[i] * h, out, p, z, k[i])
    square, square_low = 0.0, 0.0
    for m in range(n):
        total, error, error_low = 0.0, 0.0, 0.0
        for j in range(stages):
            total += b[j] * k[j, m]
            error += e[j] * k[j, m]
            if e_low.shape[0] > 0:
                error_low += e_low[j] * k[j, m]
        out[m] = x[m] + h * total
        scale = atol[m] + rtol * max(abs(x[m]), abs(out[m]))
        if scale > 0.0:
            square += (error / scale) ** 2
            square_low += (error_low / scale) ** 2
    if square == 0.0 or n == 0:
        return 0.0
    weighted = square + 0.01 * square_low
    return abs(h) * square / math.sqrt(weighted * n) if weighted > 0.0 else math.nan


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
        self._arrays = (tableau.c, tableau.a, tableau.b, tableau.e, tableau.e_low)
        self._control = (tolerances.rtol, tolerances.atol)
        self._address = flow.system.address("flow")
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
            last = h >= abs(self.bound - self.s)
            h = abs(self.bound - self.s) if last else h
            if not h >= _SMALLEST * math.ulp(self.s):
                raise StepFailure(f"the step fell to {h:.3g} at local time {self.s!r}")
            x, error = self._attempt(self.s, self.x, self.dx, direction * h)
            if error <= 1.0:
                break
            self.flow.counters.rejected += 1
            factor = _SAFETY * error ** (-1.0 / self.tableau.error_order) if math.isfinite(error) else _SHRINK
            self.h = h * max(_SHRINK, min(factor, 1.0))
        factor = _GROW if error == 0.0 else _SAFETY * error ** (-1.0 / self.tableau.error_order)
        self.h = h * min(_GROW, max(factor, _SHRINK))
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
        error = _try(
            self._address, self._arrays, s, h, x, dx, flow.p, flow.z, self._control, self._slopes, out
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
