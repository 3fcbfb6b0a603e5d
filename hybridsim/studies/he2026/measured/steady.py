"""This module computes the steady amplitude and energy of the exact motion and of fixed-step runs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from hybridsim.model import Model, load
from hybridsim.simulate import simulate
from hybridsim.solution import Solution
from hybridsim.studies.he2026.measured import settings as paper

CONTACT = "f"
# The free vibration decays by exp(-zeta wn t); exp(-30) is below rounding. Friction only adds decay.
_DECAYS = 30.0
_LEAST_PERIODS = 20
# Between two events the motion is one sine and one decaying vibration over at most half a period of the
# slower one. Gauss's rule with this many nodes is exact to rounding.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)


@dataclass(frozen=True)
class Periods:
    """Amplitude A = (max - min)/2 and energy E (integral of x^2) of each of the last periods of a run."""

    A: np.ndarray
    E: np.ndarray

    @property
    def amplitude(self) -> float:
        """Mean amplitude over the periods."""
        return float(self.A.mean())

    @property
    def energy(self) -> float:
        """Mean energy over the periods."""
        return float(self.E.mean())


@dataclass(frozen=True)
class ExactState:
    """The exact steady motion: amplitude, energy, stick fraction, stops per period, and periodicity error."""

    amplitude: float
    energy: float
    stick: float
    stops: int
    residual: float


@cache
def declared(name: str) -> Model:
    """Return a packaged model, which is read from its file once for all runs."""
    return load(name)


def settling_periods(point: paper.Point) -> int:
    """Return the number of periods after which the free vibration has decayed below rounding."""
    return max(_LEAST_PERIODS, math.ceil(_DECAYS * point.r / (2.0 * math.pi * paper.DAMPING_RATIO)))


def exact(point: paper.Point) -> ExactState:
    """Compute the exact steady motion, after the transients have decayed to rounding error."""
    count = settling_periods(point)
    solution = simulate(
        declared("dfcs"),
        (0.0, count * point.period),
        params=point.params,
        integrator="exact",
        keep="last-period",
    )
    return measured(solution, point)


def measured(solution: Solution, point: paper.Point) -> ExactState:
    """Measure the last period of a run with located events, which include the extremes of x."""
    x = solution.y[0]
    amplitude = 0.5 * float(x.max() - x.min())
    intervals = solution.modes[CONTACT]
    edges = np.array([(i.t0, i.t1) for i in intervals])
    half, middle = 0.5 * (edges[:, 1] - edges[:, 0]), 0.5 * (edges[:, 1] + edges[:, 0])
    times = middle[:, None] + half[:, None] * _NODES
    values = solution(times.ravel())[0].reshape(times.shape)
    energy = float((half * (values**2 @ _WEIGHTS)).sum())
    held = math.fsum(i.t1 - i.t0 for i in intervals if i.mode == "stick")
    stops = sum(i.mode == "stick" for i in intervals[1:])
    residual = abs(float(x[-1] - x[0])) / amplitude if amplitude > 0.0 else 0.0
    return ExactState(amplitude, energy, held / point.period, stops, residual)


def by_steps(
    point: paper.Point,
    variant: paper.Variant,
    periods: int,
    last: int,
    steps: int = paper.STEPS_PER_PERIOD,
    eps_v: float | None = None,
) -> Periods:
    """Return amplitude A and energy E of each of the last periods of a fixed-step run."""
    return periods_of(solve_by_steps(point, variant, periods, last, steps, eps_v), point, periods, last)


def solve_by_steps(
    point: paper.Point,
    variant: paper.Variant,
    periods: int,
    last: int,
    steps: int = paper.STEPS_PER_PERIOD,
    eps_v: float | None = None,
) -> Solution:
    """Run a fixed-step method from rest, and keep the last periods."""
    options: dict[str, Any] = dict(variant.options)
    if eps_v is not None:
        options["eps_v"] = eps_v
    return simulate(
        declared("dfcs"),
        (0.0, periods * point.period),
        params=point.params,
        integrator=variant.integrator,
        keep=last * point.period,
        steps_per_period=float(steps),
        **options,
    )


def periods_of(solution: Solution, point: paper.Point, periods: int, last: int) -> Periods:
    """Return A and E of each period from the values at the steps, in the way of the paper."""
    t, (x, v) = solution.t, solution.y
    edges = point.period * np.arange(periods - last, periods + 1)
    first = np.searchsorted(t, edges[:-1] - 1e-9 * point.period)
    A = 0.5 * (np.maximum.reduceat(x, first) - np.minimum.reduceat(x, first))
    h = np.diff(t)
    # The trapezoidal rule with end correction has order four, like the steps.
    parts = 0.5 * h * (x[1:] ** 2 + x[:-1] ** 2) - h**2 / 6.0 * (x[1:] * v[1:] - x[:-1] * v[:-1])
    E = np.diff(np.interp(edges, t, np.concatenate([[0.0], np.cumsum(parts)])))
    return Periods(A, E)
