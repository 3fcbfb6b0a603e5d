"""Blocks in a row, whose series are worked out for eight at once: against models, and in fractions."""

from __future__ import annotations

from fractions import Fraction
from math import comb

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.mechanics.polynomials import TERMS, shift
from hybridsim.mechanics.series_loop.mechanical_arrays import build

LAWS = {
    "hyperbolic": {"mu": 1.0, "delta": 3.0},
    "stribeck": {"mu_s": 1.0, "mu_k": 0.6, "v_s": 0.4},
}


def row(n: int, law: str, reach: int, damped: bool) -> hs.MechanicalSystem:
    """Blocks of different masses, loads and directions of their contacts, coupled with neighbours up to `reach`."""
    rng = np.random.default_rng(n)
    K = np.diag(rng.uniform(0.5, 1.5, n))
    for step in range(1, reach + 1):
        for i in range(n - step):
            K[[i, i + step], [i, i + step]] += 0.7 / step
            K[[i, i + step], [i + step, i]] -= 0.7 / step
    contacts = [
        hs.MechanicalContact(
            f"f{i}",
            {i: (-1.0, 1.0, 2.0)[i % 3]},
            rng.uniform(0.7, 1.3),
            law,
            LAWS[law],
            rng.uniform(-0.3, 0.3),
        )
        for i in range(n)
    ]
    mass, q0 = rng.uniform(0.5, 2.0, n), rng.uniform(-1.0, 1.0, n)
    return hs.MechanicalSystem(mass, 0.1 * K if damped else None, K, None, contacts, q0=q0, name="row")


@pytest.mark.parametrize("law", ["hyperbolic", "stribeck"])
@pytest.mark.parametrize(
    ("n", "reach", "damped"), [(3, 1, False), (8, 1, True), (11, 2, True), (17, 1, False)]
)
def test_a_row_moves_as_the_same_system_as_a_model(law: str, n: int, reach: int, damped: bool) -> None:
    system = row(n, law, reach, damped)
    assert len(build(system).arrays.offsets) == 2 * reach + 1
    sol = hs.simulate(system, (0, 6.0), rtol=1e-11)
    model = hs.simulate(system.to_model(), (0, 6.0), integrator="dop853", rtol=1e-12)
    assert sol.success and sol.stats["events"] > n / 2
    times = np.linspace(0, 6.0, 50)
    order = [model.names.index(name) for name in sol.names]
    np.testing.assert_allclose(sol(times), model(times)[order], atol=1e-8)


def test_blocks_with_no_order_are_left_to_the_others() -> None:
    rng = np.random.default_rng(0)
    n = 40
    K = np.eye(n)
    for _ in range(n):
        i, j = rng.choice(n, 2, replace=False)
        K[[i, j], [i, j]] += 1.0
        K[[i, j], [j, i]] -= 1.0
    contacts = [hs.MechanicalContact(f"f{i}", {i: 1.0}, 1.0, "coulomb", {"mu": 0.5}) for i in range(n)]
    assert not len(build(hs.MechanicalSystem(np.ones(n), None, K, None, contacts)).arrays.offsets)


@pytest.mark.parametrize("terms", [2, 8, 20, 31])
@pytest.mark.parametrize("d", [0.0, 0.3, -0.7, 1e-200])
def test_a_series_about_another_point_is_right_to_some_ulps_of_its_terms(terms: int, d: float) -> None:
    series, out = np.random.default_rng(terms).normal(size=(terms, 3)), np.zeros(3 * TERMS)
    for column in (0, 2):
        shift(series, column, d, terms - 1, out)
        for k in range(terms):
            parts = [
                Fraction(series[i, column]) * comb(i, k) * Fraction(d) ** (i - k) for i in range(k, terms)
            ]
            assert abs(Fraction(out[k]) - sum(parts)) <= Fraction(2e-15) * sum(map(abs, parts))


@pytest.mark.parametrize("unit", [1e-14, 1e12, 1e13, 1e18])
@pytest.mark.parametrize("rtol", [1e-9, 1e-13])
def test_the_unit_of_time_is_of_no_account(unit: float, rtol: float) -> None:
    """The same chain in another unit: powers of times and rates would leave the range of doubles at a high order."""

    def end(s: float) -> tuple[list[str], np.ndarray]:
        n = 12
        rng = np.random.default_rng(1)
        stiffness = np.diag(np.full(n, 2.5)) - np.eye(n, k=1) - np.eye(n, k=-1)
        contacts = [
            hs.MechanicalContact(
                f"f{i}", {i: 1}, 1 / s**2, "coulomb", {"mu": float(rng.uniform(0.2, 0.8))}, base=0.5 / s
            )
            for i in range(n)
        ]
        start = {"q0": rng.uniform(-2, 2, n), "v0": rng.uniform(-1, 1, n) / s}
        system = hs.MechanicalSystem(np.ones(n), None, stiffness / s**2, None, contacts, **start)
        sol = hs.simulate(system, (0, 30 * s), rtol=rtol)
        assert sol.success, sol.message
        return [f"{e.component} {e.target}" for e in sol.events], sol.x_end[:n]

    (events, x), (expected, x_expected) = end(unit), end(1.0)
    assert events == expected
    assert x == pytest.approx(x_expected, abs=1e4 * rtol)
