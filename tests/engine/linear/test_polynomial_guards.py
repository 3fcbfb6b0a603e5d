"""Taylor series of monitors that are polynomials of the states of linear modes, and their bounds."""

from __future__ import annotations

import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.events.monitor_corners import corners_of_monitors
from hybridsim.engine.linear.form import MOST_PRODUCTS
from hybridsim.engine.linear.guards import guard_terms
from hybridsim.engine.linear.modes import what_is_not_linear
from hybridsim.engine.linear.motion import functions_of_time, to_modal
from hybridsim.engine.linear.tables import LinearTables, linear_tables
from hybridsim.engine.native.constants import BOUND_TERMS
from hybridsim.engine.native.kernels import kernel
from hybridsim.engine.native.simd.products import vector_of
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System

# three states with a decay, an oscillation and a forcing of time; rows of the matrix, and amplitudes of cos(2 t)
MATRIX = ((-0.5, 0.25, 0.0), (0.0, 0.0, 1.0), (0.5, -2.0, -0.125))
FORCES = (0.0, 0.0, 1.5)
# coefficient, and exponents of x0, x1, x2 and of cos(2 t)
POLYNOMIALS: dict[str, tuple[tuple[float, tuple[int, int, int, int]], ...]] = {
    "x1**2 - x2/4 + 0.125": ((1.0, (0, 2, 0, 0)), (-0.25, (0, 0, 1, 0)), (0.125, (0, 0, 0, 0))),
    "x0*x2 + 3*x1*x2": ((1.0, (1, 0, 1, 0)), (3.0, (0, 1, 1, 0))),
    "x0*x1*x2 - x1**3": ((1.0, (1, 1, 1, 0)), (-1.0, (0, 3, 0, 0))),
    "cos(2*t)*x1 - x0**2*cos(2*t)**2": ((1.0, (0, 1, 0, 1)), (-1.0, (2, 0, 0, 2))),
}


def tables(expr: str) -> tuple[System, LinearTables, np.ndarray]:
    """The system with a corner for the monitor, its tables, and its run-time vector."""
    states = [
        hs.State(f"x{i}", 0, " + ".join(f"({a})*x{j}" for j, a in enumerate(row)) + f" + {force}*cos(2*t)")
        for i, (row, force) in enumerate(zip(MATRIX, FORCES, strict=True))
    ]
    corners = corners_of_monitors(System(hs.Model("cubic", states, monitors=[hs.Monitor("m", expr)])))
    assert corners is not None and what_is_not_linear(corners.system) is None
    p = corners.system.vector(Instant(0.0), np.zeros(0))
    made = linear_tables(corners.system, np.zeros((1, 1), dtype=np.int64), p, 1.0)
    assert made is not None
    return corners.system, made.tables, p


@kernel
def _terms(
    lin: object, x: object, p: object, arrays: object, terms: object, series: object
) -> tuple[float, float]:
    factors, w, c = arrays
    functions_of_time(lin, 0.0, p, factors, w)
    to_modal(lin, 0, x, w, c)
    return guard_terms(lin, 0, 0, c, terms, series)


def of_tables(expr: str, x: np.ndarray) -> tuple[np.ndarray, float, float, LinearTables]:
    """The Taylor coefficients of the monitor at t = 0, and the bounds."""
    system, lin, p = tables(expr)
    factors = np.zeros((2 * len(lin.kinds) + 1, 2))
    factors[-1, 0] = 1.0
    state, w = vector_of(system.n), vector_of(len(lin.factors))
    state[:] = x
    c, terms = np.zeros(lin.values.shape[1], dtype=complex), np.zeros(BOUND_TERMS)
    size, rest = _terms(lin, state, p, (factors, w, c), terms, np.zeros((3, BOUND_TERMS)))
    return terms, size, rest, lin


def by_recurrence(expr: str, x: np.ndarray, t: mpmath.mpf, count: int) -> list[mpmath.mpf]:
    """The Taylor coefficients of the monitor at t, from those of the states in 40 digits."""
    y = _flow(x, t)
    cosine = [
        mpmath.cos(2 * t + m * mpmath.pi / 2) * mpmath.mpf(2) ** m / mpmath.factorial(m) for m in range(count)
    ]
    states = [[value] for value in y]
    for m in range(count - 1):
        following = [
            sum(mpmath.mpf(a) * states[j][m] for j, a in enumerate(row)) + mpmath.mpf(force) * cosine[m]
            for row, force in zip(MATRIX, FORCES, strict=True)
        ]
        for series, value in zip(states, following, strict=True):
            series.append(value / (m + 1))
    factors, total = [*states, cosine], [mpmath.mpf(0)] * count
    for weight, exponents in POLYNOMIALS[expr]:
        product = [mpmath.mpf(weight)] + [mpmath.mpf(0)] * (count - 1)
        for factor, exponent in zip(factors, exponents, strict=True):
            for _ in range(exponent):
                product = [sum(product[i] * factor[m - i] for i in range(m + 1)) for m in range(count)]
        total = [a + b for a, b in zip(total, product, strict=True)]
    return total


def _flow(x: np.ndarray, t: mpmath.mpf) -> list[mpmath.mpf]:
    """The states at t: those of the system with cos(2 t) and sin(2 t) as two more states."""
    whole = mpmath.zeros(5)
    for i, (row, force) in enumerate(zip(MATRIX, FORCES, strict=True)):
        for j, a in enumerate(row):
            whole[i, j] = a
        whole[i, 3] = force
    whole[3, 4], whole[4, 3] = -2, 2
    start = mpmath.matrix([*map(float, x), 1, 0])
    moved = mpmath.expm(whole * t, method="taylor") * start
    return [moved[i] for i in range(3)]


@pytest.mark.parametrize("expr", POLYNOMIALS)
@pytest.mark.parametrize("seed", range(4))
def test_the_series_and_its_bounds_are_those_of_the_motion(expr: str, seed: int) -> None:
    x = np.random.default_rng(seed).uniform(-1.0, 1.0, 3)
    terms, size, rest, lin = of_tables(expr, x)
    with mpmath.workdps(40):
        exact = by_recurrence(expr, x, mpmath.mpf(0), BOUND_TERMS)
        reach = float(lin.farthest[0, 0])
        for m, (found, right) in enumerate(zip(terms, exact, strict=True)):
            assert abs(found - float(right)) * reach**m <= lin.margins[0, 0] * size
        assert 0.0 < reach < math.inf
        assert abs(float(exact[0])) <= size
        for share in (0.0, 0.3, 0.7, 1.0):
            further = by_recurrence(expr, x, mpmath.mpf(share * reach), BOUND_TERMS + 1)
            assert abs(further[-1]) <= lin.grown[0, 0] * rest


def test_the_parts_of_a_polynomial_that_are_linear_need_no_product() -> None:
    _, lin, _ = tables("x0*(2 + 3) - x1/4 + 1")
    assert len(lin.products) == 0 and not lin.is_polynomial.any()
    _, lin, _ = tables("(x0 - x1)*(x0 + x1)")
    assert len(lin.products) == 2 and lin.is_polynomial[0, 0]


def test_the_number_of_products_and_their_degree_are_limited() -> None:
    states = [hs.State(f"x{i}", 1, f"-x{i}") for i in range(12)]
    count = 12 * 13 // 2
    assert count > MOST_PRODUCTS
    model = hs.Model("many", states)
    pairs = [f"x{i}*x{k}" for i in range(12) for k in range(i + 1)]
    for monitors, is_within in (
        ([" + ".join(pairs[:MOST_PRODUCTS])], True),
        ([" + ".join(pairs[: MOST_PRODUCTS + 1])], False),
        ([" + ".join(pairs[::2]), " + ".join(pairs[1::2])], False),
        (["x0**8"], True),
        (["x0**9"], False),
    ):
        named = tuple(hs.Monitor(f"m{k}", expr) for k, expr in enumerate(monitors))
        corners = corners_of_monitors(System(replace(model, monitors=named)))
        assert corners is not None
        assert (what_is_not_linear(corners.system) is None) == is_within
