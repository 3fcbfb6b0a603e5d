"""Series of high order: against the ones with error bounds, against 40 digits, and at the ends of their reach."""

from __future__ import annotations

import itertools
import math
import random

import mpmath
import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.series.interpreter import rough_inverse_root
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.series_at import SeriesRun, series_order
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.testing.measuring import SCENES

MODELS = [info.name for info in hs.list_models()] + [str(path) for path in sorted(SCENES.glob("*.toml"))]


@pytest.mark.parametrize("name", MODELS, ids=lambda name: name.rsplit("/")[-1])
def test_the_optimised_tape_is_the_tape(name: str) -> None:
    """States, guards and monitors to third order in every mode, or in 500 at random, to the last bit."""
    model = hs.load(name)
    system = System(model)
    p = system.vector(Instant(0.3), np.array(list(model.discrete_values().values()), dtype=float))
    x, zero = 0.5 + 0.3 * np.sin(np.arange(1.0, 1.0 + system.n)), np.zeros(system.n)
    every = list(itertools.product(*(range(len(a.modes)) for a in system.automata)))
    for modes in random.Random(1).sample(every, min(500, len(every))):
        z = np.array(modes, dtype=np.int64)
        full = system.series(0.1, x, p, z, zero, 0.0)
        run = SeriesRun(system, p, z, Tolerances(1e-9, zero))
        run.expand(0.1, x, 1.0)
        active = system.active(z)
        for flow_registers, expected in (
            (run.states, full.states),
            (run.optimised.guards[active], full.guards[active]),
            (run.optimised.monitors, full.monitors),
        ):
            np.testing.assert_array_equal(run.V[flow_registers, :4], expected)


# a scalar equation x' = f(x, t) whose solution is known, at t = 0.3
KNOWN = {
    "exp": ("x", lambda t: mpmath.exp(t)),
    "product of exp and sin": ("x*cos(t)", lambda t: mpmath.exp(mpmath.sin(t))),
    "log": ("exp(-x)", lambda t: mpmath.log(1 + t)),
    "tan": ("1 + x**2", lambda t: mpmath.tan(t)),
    "tanh": ("1 - x*x", lambda t: mpmath.tanh(t)),
    "quotient": ("-x**2/(1 + 0*t)", lambda t: 1 / (1 + t)),
    "root": ("1/(2*x)", lambda t: mpmath.sqrt(1 + t)),
    "arc tangent": ("1/(1 + tan(x)**2)", lambda t: mpmath.atan(t)),
    "arc sine": ("1/sqrt(1 - sin(x)**2)", lambda t: mpmath.asin(t)),
    "inverse functions": (
        "cos(asin(t)) + 0*atan(t) + 0*acos(t)",
        lambda t: (t * mpmath.sqrt(1 - t * t) + mpmath.asin(t)) / 2,
    ),
    "hyperbolic": ("sinh(t) + 0*cosh(x)", lambda t: mpmath.cosh(t)),
}


@pytest.mark.parametrize("name", KNOWN)
def test_coefficients_against_forty_digits(name: str) -> None:
    rate, solution = KNOWN[name]
    t0 = 0.3
    with mpmath.workdps(60):
        expected = [float(c) for c in mpmath.taylor(solution, mpmath.mpf(t0), 16)]
        start = float(solution(mpmath.mpf(t0)))
    system = System(hs.Model("known", states=[hs.State("x", start, der=rate)]))
    run = SeriesRun(
        system,
        system.vector(Instant(0.0), np.zeros(0)),
        np.zeros(0, dtype=np.int64),
        Tolerances(1e-14, np.zeros(1)),
    )
    run.expand(t0, np.array([start]), 1.0)
    found = run.V[run.states[0]]
    assert len(found) == series_order(1e-14, system.is_linear) + 1
    # relative to the size of coefficients of this order near here: R**-k with the distance R to the nearest pole
    size = np.maximum(np.abs(expected), 1e-3 * np.max(np.abs(expected)))
    assert np.max(np.abs(found[:17] - expected) / size) < 1e-12


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12, 1e-13])
def test_the_error_is_the_tolerance(rtol: float) -> None:
    """A nonlinear pendulum over 20 swings against 40 digits by elliptic functions."""
    model = hs.Model("pendulum", states=[hs.State("a", 0, der="w"), hs.State("w", 1.5, der="-sin(a)")])
    sol = hs.simulate(model, (0, 40), integrator="taylor", rtol=rtol)
    times = np.linspace(0, 40, 41)
    with mpmath.workdps(40):
        k = mpmath.mpf(0.75)  # sin(a/2) = k sn(t, k), from rest at the bottom with w = 2 k
        exact = [float(2 * mpmath.asin(k * mpmath.ellipfun("sn", t, k=k))) for t in map(mpmath.mpf, times)]
    assert np.max(np.abs(sol(times)[0] - exact)) < 100 * rtol
    assert sol.stats["steps"] < 100 * math.log10(1 / rtol)


def test_a_branch_that_the_series_does_not_know_of() -> None:
    """x' = -sqrt(x): the series is a parabola that rises again; the motion stays at zero, as far as it has a value."""
    model = hs.Model("tank", states=[hs.State("x", 1, der="-sqrt(x)")])
    sol = hs.simulate(model, (0, 1.999), integrator="taylor")
    assert sol(1.999)[0] == pytest.approx((1 - 1.999 / 2) ** 2, rel=1e-6)
    beyond = hs.simulate(model, (0, 3), integrator="taylor")
    assert not beyond.success or abs(beyond(3.0)[0]) < 1e-9


def test_a_saturated_force_is_seen_again() -> None:
    """tanh(v/v0) is constant to rounding while the body is fast: the step must not run through its turning point."""
    model = hs.load("free-decay").regularized("tanh", v0=1e-3)
    sol = hs.simulate(model, (0, 3), integrator="taylor", rtol=1e-9)
    reference = hs.simulate(model, (0, 3), integrator="scipy-radau", rtol=1e-9)
    assert sol(3.0) == pytest.approx(reference(3.0), rel=1e-6, abs=1e-8)


@pytest.mark.parametrize("n", [3, 14, 40])
def test_rough_roots(n: int) -> None:
    """Of every double there is: where a solution grows beyond bounds its tolerances over its terms are tiny."""
    for exponent in range(-323, 309):
        for x in (10.0**exponent, 1.7 * 10.0 ** min(exponent, 307)):
            assert rough_inverse_root(x, n) == pytest.approx(1.0 / float(mpmath.root(x, n)), rel=5e-4)
    assert rough_inverse_root(0.0, n) == math.inf and rough_inverse_root(math.inf, n) == 0.0
