"""A table fitted to noisy points: the truth without noise, and no worse than the truth with noise of known size."""

from __future__ import annotations

from math import log

import numpy as np
import pytest

import hybridsim as hs

AT, MU = np.array([0.0, 0.05, 0.2, 0.5, 1.2, 2.0]), np.array([0.6, 0.42, 0.35, 0.33, 0.4, 0.45])
SIGMA, COUNT = 0.01, 300


def speeds(seed: int, count: int = COUNT) -> np.ndarray:
    """Speeds in no order, and among them the ends of the table."""
    return np.append(np.random.default_rng(seed).uniform(0.0, 2.0, count - 2), AT[[0, -1]])


def fitted(table: hs.LawTable, v: np.ndarray) -> np.ndarray:
    return np.array([table.value(each) for each in v])


@pytest.mark.parametrize("seed", range(3))
def test_without_noise_the_truth_is_found(seed: int) -> None:
    v = speeds(seed)
    table = hs.LawTable.fit(v, np.interp(v, AT, MU), knots=6)
    assert table.interpolation == "linear"
    assert table.at == pytest.approx(AT, abs=1e-6) and table.values == pytest.approx(MU, abs=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_no_other_table_of_so_many_knots_fits_better(seed: int) -> None:
    """The truth is such a table, so the sum of squares is at most that of the noise.

    Then the distance to the truth is at most twice the projection of the noise on the functions around it. They have
    10 parameters, and a sum of squares of 10 normal numbers is below 30 with a probability of 99.9 %.
    """
    v = speeds(seed)
    truth = np.interp(v, AT, MU)
    noise = SIGMA * np.random.default_rng(100 + seed).standard_normal(len(v))
    found = fitted(hs.LawTable.fit(v, truth + noise, knots=6), v)
    assert np.sum((found - truth - noise) ** 2) <= np.sum(noise**2)
    assert np.sum((found - truth) ** 2) <= 4 * 30 * SIGMA**2


def test_two_knots_are_the_line_of_least_squares() -> None:
    """Slope 1/2 and the mean 4/3 at x = 1: the line through (0, 1), (1, 1), (2, 2) of least squares."""
    table = hs.LawTable.fit([0, 1, 2], [1, 1, 2], knots=2, name="c", over="T")
    assert (table.name, table.over.text, table.at) == ("c", "T", (0, 2))
    assert table.values == pytest.approx([5 / 6, 11 / 6], rel=1e-12)


def test_as_many_knots_as_arguments_pass_through_all_points() -> None:
    at, values = [0, 1, 2.5, 3], [0.5, 0.3, 0.4, 0.1]
    table = hs.LawTable.fit(at, values, knots=4)
    assert [table.value(each) for each in at] == pytest.approx(values, abs=1e-9)


@pytest.mark.parametrize("knots", [45, 60])
def test_more_knots_than_a_straight_line_needs(knots: int) -> None:
    """No knot moves from its first place, because each fit is exact."""
    table = hs.LawTable.fit(range(60), [0.5 - 0.005 * k for k in range(60)], knots=knots)
    assert len(table.at) == knots
    assert [table.value(k) for k in (0, 30, 59)] == pytest.approx([0.5, 0.35, 0.205], rel=1e-9)


def test_the_order_of_points_does_not_matter_and_arguments_may_repeat() -> None:
    """Two values at each argument count as their mean, since each has as many."""
    at, values, v = [0, 0.7, 2], [0.5, 0.3, 0.4], speeds(7, 40)
    mu = np.interp(v, at, values)
    twice = hs.LawTable.fit(np.append(v, v[::-1]), np.append(mu + 0.1, (mu - 0.1)[::-1]), knots=3)
    assert twice.at == pytest.approx(at, abs=1e-5) and twice.values == pytest.approx(values, abs=1e-5)


def test_a_run_with_a_fitted_law() -> None:
    """mu = 0.5 - v/10 and N = 10 as in a law of a file: v = 5 - 2*exp(t) from v = 3 to rest at log(5/2)."""
    table = hs.LawTable.fit([0, 1, 2, 3], [0.5, 0.4, 0.3, 0.2], knots=2)
    law = hs.FrictionLaw("fitted", slip="mu*N", stick="mu*N", tables=[table])
    states = [hs.State("v", 3, "-f", nominal=1)]
    model = hs.Model("m", states, contacts=[hs.Contact("f", "v", 10, law)])
    sol = hs.simulate(model, (0, 2))
    assert sol.integrator == "exact"
    assert sol.event_times("f")[0] == pytest.approx(log(2.5), rel=1e-12)


@pytest.mark.parametrize(
    ("at", "values", "knots", "message"),
    [
        ([0, 1, 2], [1, 2], 2, "`at` has 3 numbers, but `values` has 2"),
        ([[0, 1]], [[1, 2]], 2, "a value of `at`"),
        ([0, 1, np.nan], [1, 2, 3], 2, "not finite"),
        ([0, 1, 2], [1, 2, np.inf], 2, "not finite"),
        ([0, 1, 1], [1, 2, 3], 3, "`knots` cannot be 3"),
        ([1, 1], [1, 2], 2, "`at` contains fewer than two different numbers"),
        ([0, 1, 2], [1, 2, 3], 1, "`knots` cannot be 1"),
        ([0, 1, 2], [1, 2, 3], 2.5, "`knots` cannot be 2.5"),
        (["a", 1, 2], [1, 2, 3], 2, "a value of `at` cannot be 'a'"),
    ],
)
def test_what_is_refused(at: object, values: object, knots: object, message: str) -> None:
    with pytest.raises(hs.UsageError, match=message):
        hs.LawTable.fit(at, values, knots)  # type: ignore[arg-type]  # wrong on purpose
