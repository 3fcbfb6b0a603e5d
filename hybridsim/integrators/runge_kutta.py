"""Embedded Runge-Kutta pairs from their tableau: a new method is a tableau and a name."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hybridsim.engine.hermite import hermite
from hybridsim.engine.stepping import Dense, Flow, Step, StepFailure, Tolerances

# Step control of Hairer, Norsett and Wanner 1993, section II.4: safety factor and bounds of the change of a step.
_SAFETY, _SHRINK, _GROW = 0.9, 0.2, 10.0
_SMALLEST = 10.0  # a step of fewer ulps of the local time makes no progress


@dataclass(frozen=True)
class Tableau:
    """An explicit pair: stages at c, strictly lower triangular a, weights b, and e = b - b_hat for the error.

    order is that of b, error_order that of the error estimate (of the lower order method, plus one in h).
    """

    c: np.ndarray
    a: np.ndarray
    b: np.ndarray
    e: np.ndarray
    order: int
    error_order: int


class RungeKuttaStepper:
    """Steps a pair through one segment, with local extrapolation and dense output of degree 7.

    The dense output is the Hermite polynomial on the Taylor coefficients of the flow at both ends, so it is
    as good as any pair up to order 7; event times are refined by repeating the step.
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
        self.s, self.x, self.dx = 0.0, x0, self._rhs(0.0, x0)
        self.h = first_step or self._first_step()
        self.left = self._series(0.0, x0)

    def step(self) -> Step:
        """The next accepted step."""
        direction = math.copysign(1.0, self.bound)
        while True:
            h = min(self.h, self.tolerances.max_step)
            last = h >= abs(self.bound - self.s)
            h = abs(self.bound - self.s) if last else h
            if h < _SMALLEST * math.ulp(self.s):
                raise StepFailure(f"the step fell to {h:.3g} at local time {self.s!r}")
            x, error = self._try(self.s, self.x, self.dx, direction * h)
            if error <= 1.0:
                break
            self.flow.counters.rejected += 1
            factor = _SAFETY * error ** (-1.0 / self.tableau.error_order) if math.isfinite(error) else _SHRINK
            self.h = h * max(_SHRINK, min(factor, 1.0))
        factor = _GROW if error == 0.0 else min(_GROW, _SAFETY * error ** (-1.0 / self.tableau.error_order))
        self.h = h * max(factor, _SHRINK)
        s0, x0, left = self.s, self.x, self.left
        self.s, self.x = self.bound if last else s0 + direction * h, x
        self.dx, self.left = self._rhs(self.s, x), self._series(self.s, x)
        return Step(s0, self.s, x0, x, hermite(s0, self.s, left, self.left))

    def restep(self, step: Step, s: float) -> Step:
        """The step up to s in one step of exactly that length."""
        x, _ = self._try(step.s0, step.x0, self._rhs(step.s0, step.x0), s - step.s0)
        return Step(step.s0, s, step.x0, x, self._lazy(step.s0, s, step.x0, x))

    def _lazy(self, s0: float, s1: float, x0: np.ndarray, x1: np.ndarray) -> Dense:
        return lambda s: hermite(s0, s1, self._series(s0, x0), self._series(s1, x1))(s)

    def _rhs(self, s: float, x: np.ndarray) -> np.ndarray:
        self.flow.counters.rhs_evaluations += 1
        return self.flow.rhs(s, x)

    def _series(self, s: float, x: np.ndarray) -> np.ndarray:
        zero = np.zeros(self.flow.n)
        return self.flow.system.series(s, x, self.flow.p, self.flow.z, zero, 0.0).states

    def _scale(self, x: np.ndarray) -> np.ndarray:
        return self.tolerances.atol + self.tolerances.rtol * np.abs(x)

    def _try(self, s: float, x: np.ndarray, dx: np.ndarray, h: float) -> tuple[np.ndarray, float]:
        """The state after h, and the error estimate in units of the tolerance (root mean square)."""
        t = self.tableau
        k = np.empty((len(t.c), len(x)))
        k[0] = dx
        for i in range(1, len(t.c)):
            k[i] = self._rhs(s + t.c[i] * h, x + h * (t.a[i, :i] @ k[:i]))
        after = x + h * (t.b @ k)
        scale = np.maximum(self._scale(x), self._scale(after))
        ratio = h * (t.e @ k) / np.where(scale > 0.0, scale, 1.0)
        return after, float(np.sqrt(np.mean(ratio**2)))

    def _first_step(self) -> float:
        """Starting step of Hairer, Norsett and Wanner 1993, section II.4."""
        scale = np.where(self._scale(self.x) > 0.0, self._scale(self.x), 1.0)
        d0 = float(np.sqrt(np.mean((self.x / scale) ** 2)))
        d1 = float(np.sqrt(np.mean((self.dx / scale) ** 2)))
        h0 = 1e-6 * abs(self.bound) if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1
        direction = math.copysign(1.0, self.bound)
        ahead = self._rhs(direction * h0, self.x + direction * h0 * self.dx)
        d2 = float(np.sqrt(np.mean(((ahead - self.dx) / scale) ** 2))) / h0
        largest = max(d1, d2)
        h1 = (
            max(1e-6 * abs(self.bound), 1e-3 * h0)
            if largest <= 1e-15
            else (0.01 / largest) ** (1.0 / self.tableau.order)
        )
        return min(100.0 * h0, h1, abs(self.bound))
