"""Rodas5P: its coefficients against order conditions and stability, the method against closed forms."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from integrators.order_conditions import Tree, density, trees

import hybridsim as hs
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System
from hybridsim.integrators.rosenbrock.rodas5p import TABLEAU
from hybridsim.integrators.rosenbrock.step import factor, linearise, solve

# Back to the variables of the order conditions (Hairer and Wanner 1996, section IV.7)
GAMMA = np.linalg.inv(np.eye(8) / TABLEAU.gamma - TABLEAU.c)
ALPHA = TABLEAU.a @ GAMMA
BETA = ALPHA + GAMMA
ONES = np.ones(8)


def stages(tree: Tree) -> np.ndarray:
    """Elementary weights: a single branch is weighed by beta, several by alpha."""
    if len(tree) == 1:
        return BETA @ stages(tree[0])
    out = ONES
    for branch in tree:
        out = out * (ALPHA @ stages(branch))
    return out


def defect(weights: np.ndarray, size: int, theta: float = 1.0) -> float:
    """Largest defect of the conditions of one order for weights of the stages U."""
    b = weights @ GAMMA
    return max(abs(b @ stages(tree) - theta**size / density(tree)) for tree in trees(size))


def at_infinity(weights: np.ndarray) -> float:
    """The stability function R(z) = 1 + z b (1 - z beta)^-1 1 for z without bound."""
    return float(1 - weights @ GAMMA @ np.linalg.solve(BETA, ONES))


def test_nodes_and_factors_of_the_time_derivative_are_row_sums() -> None:
    assert ALPHA.sum(axis=1) == pytest.approx(TABLEAU.nodes, abs=2e-14)
    assert GAMMA.sum(axis=1) == pytest.approx(TABLEAU.d, abs=2e-14)


def test_the_method_has_order_five_and_the_embedded_one_four() -> None:
    for size in range(1, 6):
        assert defect(TABLEAU.m, size) < 2e-14
        assert size == 5 or defect(TABLEAU.m - TABLEAU.e, size) < 2e-14
    assert defect(TABLEAU.m, 6) > 1e-3
    assert defect(TABLEAU.m - TABLEAU.e, 5) > 1e-3


@pytest.mark.parametrize("theta", [0.2, 0.5, 0.9])
def test_the_dense_output_has_order_four(theta: float) -> None:
    first, second, third = TABLEAU.dense
    weights = theta * (TABLEAU.m + (1 - theta) * (first + theta * (second + theta * third)))
    for size in range(1, 5):
        assert defect(weights, size, theta) < 1e-13
    assert defect(weights, 5, theta) > 1e-5


def test_it_is_stable_for_every_stiff_rate() -> None:
    """|R| <= 1 along the imaginary axis, no pole to its left, and R = 0 at infinity: L-stable."""
    assert abs(at_infinity(TABLEAU.m)) < 1e-13
    assert abs(at_infinity(TABLEAU.m - TABLEAU.e)) < 1e-13
    b = TABLEAU.m @ GAMMA
    for y in np.logspace(-3, 6, 2001):
        assert abs(1 + 1j * y * b @ np.linalg.solve(np.eye(8) - 1j * y * BETA, ONES)) <= 1 + 1e-12
    assert np.linalg.eigvals(BETA) == pytest.approx(np.full(8, TABLEAU.gamma), abs=1e-2)


def test_linear_systems() -> None:
    draw = np.random.default_rng(5)
    for n in (1, 2, 5, 12):
        a, b = draw.normal(size=(n, n)), draw.normal(size=n)
        a[0, 0] = 0.0 if n > 1 else 1.0  # needs a pivot
        lu, pivots, x = a.copy(), np.empty(n, dtype=np.int64), b.copy()
        assert factor(lu, pivots)
        solve(lu, pivots, x)
        assert a @ x == pytest.approx(b, abs=1e-12)
    assert not factor(np.ones((2, 2)), np.empty(2, dtype=np.int64))
    assert not factor(np.full((2, 2), math.nan), np.empty(2, dtype=np.int64))


def test_the_linearisation_is_exact() -> None:
    """Against derivatives by hand, with time in an angle and outside of one."""
    states = [
        hs.State("x", 0.3, "v"),
        hs.State("v", 0.7, "-exp(x)*v**3 + a*sin(3*t + x) + t*t*x"),
        hs.State("w", 0.2, "tanh(w*x)/(1 + v*v)"),
    ]
    system = System(hs.Model("m", states=states, parameters={"a": 2.5}))
    s, (x, v, w), a = 0.4, (0.3, 0.7, 0.2), 2.5
    z = np.zeros(0, dtype=np.int64)
    p = system.vector(Instant(1.25), np.zeros(0))
    t = 1.25 + s
    optimised = system.optimised_tape(z)
    inputs = system.registers.inputs
    V = np.zeros((system.registers.count, 2))
    V[inputs.constants, 0], V[inputs.parameters, 0] = inputs.values[:, 0], p[inputs.sources]
    from hybridsim.engine.series.interpreter import advance

    advance(optimised.constant_rows, V, 0)
    jacobian, rate = np.empty((3, 3)), np.empty(3)
    linearise(
        optimised.rows,
        (int(inputs.time[0]), inputs.states, optimised.derivatives),
        s,
        np.array([x, v, w]),
        V,
        jacobian,
        rate,
    )
    bell = 1 / math.cosh(w * x) ** 2 / (1 + v * v)
    expected = [
        [0, 1, 0],
        [
            -math.exp(x) * v**3 + a * math.cos(3 * t + x) + t * t,
            -3 * math.exp(x) * v * v,
            0,
        ],
        [w * bell, -2 * v * math.tanh(w * x) / (1 + v * v) ** 2, x * bell],
    ]
    assert jacobian == pytest.approx(np.array(expected), rel=1e-14, abs=1e-15)
    assert rate == pytest.approx([0, 3 * a * math.cos(3 * t + x) + 2 * t * x, 0], rel=1e-14)


def moving(rate: float) -> hs.Model:
    """x follows cos(t): x' = -rate (x - cos t) - sin t, and y' = -y x with y = exp(-sin t) for x = cos t."""
    return hs.Model(
        "moving",
        states=[hs.State("x", 1, f"-{rate}*(x - cos(t)) - sin(t)"), hs.State("y", 1, "-y*x")],
    )


def truth(t: float) -> np.ndarray:
    return np.array([math.cos(t), math.exp(-math.sin(t))])


def test_the_observed_order_is_the_claimed_one() -> None:
    errors = []
    for n in (16, 32, 64, 128):
        h = 2.0 / n
        sol = hs.simulate(
            moving(1.0), (0, 2), integrator="rodas5p", rtol=0.9, atol=1e9, max_step=h, first_step=h
        )
        assert sol.stats["steps"] == n
        errors.append(np.abs(sol(2.0) - truth(2.0)).max())
    assert [math.log2(a / b) for a, b in pairwise(errors)][-1] == pytest.approx(5, abs=0.2), errors


@pytest.mark.parametrize("rate", [1.0, 1e3, 1e6])
@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
def test_the_error_follows_the_tolerance_however_stiff(rate: float, rtol: float) -> None:
    """At the steps and between them; an explicit method would take rate/3 steps."""
    sol = hs.simulate(moving(rate), (0, 10), integrator="rodas5p", rtol=rtol, atol=rtol)
    assert sol.stats["steps"] < 1000
    error = max(np.abs(sol(t) - truth(t)).max() for t in np.linspace(0, 10, 501))
    assert rtol * 1e-4 < error < 100 * rtol


@pytest.mark.parametrize("at", [5e-324, 1.5e-323, 1e-310])
def test_a_step_to_a_denormal_time_ends(at: float) -> None:
    """The reciprocal of such a step is infinite; x' = -x with x + 1 at the time and at 0.5 has a closed form."""
    text = f"""schema = 1
name = "denormal"
[states]
x = {{ start = 1, der = "-x" }}
[schedules.s]
times = [{at!r}, 0.5]
reset = {{ x = "x + 1" }}
"""
    sol = hs.simulate(hs.Model.from_toml(text), (0, 2), integrator="rodas5p", limits={"seconds": 60})
    assert (sol.status, len(sol.events)) == ("finished", 2)
    assert sol(2.0)[0] == pytest.approx(2 * math.exp(-2) + math.exp(-1.5), rel=1e-7)
