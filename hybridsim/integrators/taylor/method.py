"""This module integrates by Taylor series of the flow, which are also the dense output."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hybridsim.engine.native.time_grid import on_the_grid
from hybridsim.engine.record.segments import Dense
from hybridsim.engine.roots.defect_check import BETWEEN
from hybridsim.engine.roots.vanishing_terms import STACK_ROWS, where_it_ends
from hybridsim.engine.run.compiled_loop import CompiledLoop, compile_loops
from hybridsim.engine.run.stepping import Flow, Step, Stepper, Watch
from hybridsim.engine.series.interpreter import polynomials
from hybridsim.engine.series.vanishing_kinds import KINDS, power_of, register_of
from hybridsim.engine.system.failures import Collapsed, Creeping
from hybridsim.engine.system.programs.mode_code import computed_rates, fading
from hybridsim.engine.system.series_at import SeriesRun
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.integrators.contract import EXPLICIT, NEEDS_TAPE, Integrator
from hybridsim.integrators.taylor.compiled_loop import TaylorKernels

_SMALLEST = 10.0  # a remainder of fewer ulps of the local time is merged into the last step
_SHORTER = 0.25  # factor on a step at whose end the series does not satisfy the equation
_DEFECT = 100.0  # largest defect of a step, in tolerances: in the slope the last term of order p is p times as large
_WORTH_ITS_OWN = 0.9  # a first step that covers more than this share of the segment covers all of it
_RETRIES = 30
# This many consecutive steps, each shortened this often, make no progress: the solution ends at the edge of the domain
# of its rate, such as sqrt of a level that falls to zero, and each series crosses it within the tolerance.
_CREEPING, _OFTEN = 1000, 4


class TaylorStepper:
    """Advances Taylor's method through one segment."""

    def __init__(
        self, flow: Flow, x0: np.ndarray, bound: float, tolerances: Tolerances, first_step: float | None
    ) -> None:
        self.flow, self.bound, self.tolerances = flow, bound, tolerances
        self.series = SeriesRun(flow.system, flow.p, flow.z, tolerances)
        self.computed = np.array(computed_rates(flow.system, flow.z))
        self.fading = np.array(fading(flow.system, flow.z), dtype=np.int64)
        self.stack_arrays = np.empty(self.series.order), np.empty((STACK_ROWS, self.series.order + 2))
        self.s, self.x = 0.0, x0
        self.longest = first_step or math.inf
        # consecutive steps that were shortened often and do not shrink further: count, start, and first length
        self.creeping, self.since, self.shortest = 0, 0.0, 0.0

    def step(self) -> Step:
        """Return the next step, over which the Taylor series are accurate."""
        direction = math.copysign(1.0, self.bound)
        left = abs(self.bound - self.s)
        longest = min(left, self.tolerances.max_step)
        if self.longest < _WORTH_ITS_OWN * longest:
            longest = self.longest
        self.longest = math.inf
        self.flow.counters.rhs_evaluations += 1
        h, coefficients = self.series.expand(self.s, self.x, longest)
        order = coefficients.shape[1] - 1
        for number in self.fading:
            u = power_of(number) * self.series.V[register_of(number)]
            end = where_it_ends(u, number % KINDS, order, direction * h, *self.stack_arrays, 0)
            h = min(h, abs(end))
        smallest = _SMALLEST * math.ulp(abs(self.bound))
        before = self.flow.counters.rejected
        for _ in range(_RETRIES):
            last = h >= left - smallest  # the rest would be too short for another step
            h = left if last else h if math.isnan(h) else abs(on_the_grid(self.s, direction * h))
            x1 = coefficients @ (direction * h) ** np.arange(coefficients.shape[1])
            if math.isnan(h) or (
                self._holds_between(coefficients, direction * h)
                and self._holds(coefficients, self.x, x1, self.s, direction * h)
            ):
                break
            self.flow.counters.rejected += 1
            h *= _SHORTER
        if self.flow.counters.rejected < before + _OFTEN:
            self.creeping = 0
        elif self.creeping and h > 0.5 * self.shortest:
            self.creeping += 1
        else:
            self.creeping, self.since, self.shortest = 1, self.s, h
        if self.creeping == _CREEPING:
            raise Creeping(
                f"{_CREEPING} consecutive steps were discarded because they were 100 times shorter than the Taylor "
                f"series allow; the last step had the length {h:.3g}",
                self.since,
            )
        if not h > 0.0:
            raise Collapsed(f"the step size fell to {h:.3g}")
        s0, x0 = self.s, self.x
        self.s = self.bound if last else s0 + direction * h
        self.x = self.flow.landed(self.s, x1)
        dense = _dense(s0, coefficients)

        def holds(s: float) -> bool:
            return self._holds(coefficients, x0, dense(np.array([s]))[0], s0, s - s0)

        return Step(s0, self.s, x0, x1, dense, holds=holds)

    def _holds_between(self, coefficients: np.ndarray, h: float) -> bool:
        """Return whether the series satisfy the equations inside a step, or True if no rate seems constant."""
        moves = np.abs(coefficients[:, 2:]) @ np.abs(h) ** np.arange(2, coefficients.shape[1])
        still = moves <= self.tolerances.atol + self.series.rtol * np.abs(self.x)
        if not (still & self.computed).any():
            return True
        times = h * np.array(BETWEEN)
        states = np.empty((len(times), len(self.x)))
        polynomials(coefficients, times, states)
        return all(
            self._holds(coefficients, self.x, x, self.s, d) for d, x in zip(times, states, strict=True)
        )

    def _holds(self, coefficients: np.ndarray, x0: np.ndarray, x1: np.ndarray, s0: float, d: float) -> bool:
        """Return whether the series satisfy the differential equation at a distance `d` from their origin.

        The terms of a series do not show effects below rounding at its origin: a saturated tanh, the other
        branch of a root, or a friction that is larger only near rest.
        """
        powers = np.arange(1, coefficients.shape[1])
        slope = coefficients[:, 1:] @ (powers * d ** (powers - 1))
        with np.errstate(invalid="ignore"):  # infinite rates less infinite slopes are not a small defect
            defect = abs(d) * np.abs(slope - self.flow.rhs(s0 + d, x1))
        self.flow.counters.rhs_evaluations += 1
        scale = self.tolerances.atol + self.series.rtol * np.maximum(np.abs(x0), np.abs(x1))
        change = np.abs(coefficients[:, 1:]) @ np.abs(d) ** powers
        return bool((defect <= _DEFECT * (scale + self.series.rtol * change)).all())

    def restep(self, step: Step, s: float) -> Step:
        """Repeat a step with a shorter length, because its Taylor series is inaccurate at the local time `s`."""
        self.flow.counters.rejected += 1
        self.s, self.x, self.longest = step.s0, step.x0, _SHORTER * abs(s - step.s0)
        return self.step()


def _dense(s0: float, coefficients: np.ndarray) -> Dense:
    def dense(s: np.ndarray) -> np.ndarray:
        out = np.empty((len(s), coefficients.shape[0]))
        polynomials(coefficients, np.asarray(s - s0, dtype=float), out)
        return out

    return dense


@dataclass(frozen=True)
class Taylor(Integrator):
    """Taylor series by recurrences over the operations of the model, with order and step chosen by the tolerance.

    The order is 1.5 (1 - ln(rtol)/2), for linear modes with 1.6 instead of 1.5. The step is the one at which
    the last two terms reach the tolerance, which is close to the least work for an accuracy. Guards have
    their own series, and the step ends where these stop being accurate.

    When to choose it: tight tolerances, 1e-9 and below, and whenever events are more important than anything
    else.
    """

    name: ClassVar[str] = "taylor"
    title: ClassVar[str] = "Taylor series by automatic differentiation"
    order: ClassVar[str] = "by the tolerance"
    reference: ClassVar[str] = "Jorba and Zou 2005, doi:10.1080/10586458.2005.10128904"
    when: ClassVar[str] = "highest accuracy; smooth modes, not stiff"
    lacks: ClassVar[dict[str, str]] = {
        **EXPLICIT,
        "corners": "its series do not detect a jump inside a mode ('hybridsim check' names the jump)",
        "functions": NEEDS_TAPE,
    }
    dense_is_accurate: ClassVar[bool] = True
    has_compiled_loop: ClassVar[bool] = True

    def prepare(self, system: System) -> None:
        """Compile the event loop of the method."""
        compile_loops(system, TaylorKernels)

    def compiled_loop(self, system: System, tolerances: Tolerances, longest: float) -> CompiledLoop:
        """Return the compiled event loop of the method."""
        return CompiledLoop(TaylorKernels(system, tolerances, longest))

    def start(
        self,
        flow: Flow,
        x0: np.ndarray,
        s_bound: float,
        tolerances: Tolerances,
        first_step: float | None,
        watch: Watch,
    ) -> Stepper:
        """Begin to integrate the motion up to the next event."""
        return TaylorStepper(flow, x0, s_bound, tolerances, first_step)
