"""Tableaus against order conditions, and the methods they make against closed forms."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from integrators.order_conditions import defects, trees

import hybridsim as hs
from hybridsim.integrators.runge_kutta.dop853 import Dop853
from hybridsim.integrators.runge_kutta.step import Tableau
from hybridsim.integrators.runge_kutta.tsit5 import Tsit5

BOTH = [Dop853, Tsit5]


def largest(tableau: Tableau, weights: np.ndarray, order: int) -> float:
    """Largest defect of the conditions of one order, where coefficients of any size cancel."""
    found = defects(tableau.a, weights, order)
    sizes = defects(np.abs(tableau.a), np.abs(weights), order) + 1
    return float(np.max(np.abs(found) / sizes))


def test_there_are_as_many_trees_as_known() -> None:
    """Hairer, Norsett and Wanner 1993, Table II.2.1."""
    assert [len(trees(size)) for size in range(1, 9)] == [1, 1, 2, 4, 9, 20, 48, 115]


@pytest.mark.parametrize("method", BOTH)
def test_nodes_are_row_sums(method: type) -> None:
    assert method.tableau.a.sum(axis=1) == pytest.approx(method.tableau.c, abs=4e-15)


@pytest.mark.parametrize("method", BOTH)
def test_the_method_has_its_order_and_no_more(method: type) -> None:
    tableau = method.tableau
    for order in range(1, tableau.order + 1):
        assert largest(tableau, tableau.b, order) < 4e-15, order
    assert np.max(np.abs(defects(tableau.a, tableau.b, tableau.order + 1))) > 1e-7


@pytest.mark.parametrize(
    ("method", "low", "order"), [(Tsit5, False, 4), (Dop853, False, 5), (Dop853, True, 3)]
)
def test_the_embedded_methods_have_theirs(method: type, low: bool, order: int) -> None:
    tableau = method.tableau
    embedded = tableau.b - (tableau.e_low if low else tableau.e)
    for k in range(1, order + 1):
        assert largest(tableau, embedded, k) < 1e-14, k
    assert np.max(np.abs(defects(tableau.a, embedded, order + 1))) > 1e-6


def motion(t: float) -> np.ndarray:
    """x'' + x = sin(5 t) from (1, 0)."""
    x = math.cos(t) + 5 / 24 * math.sin(t) - math.sin(5 * t) / 24
    return np.array([x, -math.sin(t) + 5 / 24 * math.cos(t) - 5 / 24 * math.cos(5 * t)])


LINEAR = hs.Model("linear", states=(hs.State("x", 1, "v"), hs.State("v", 0, "-x + sin(5*t)")))


@pytest.mark.parametrize(("method", "counts"), [(Tsit5, (64, 128, 256)), (Dop853, (10, 20, 40))])
def test_the_observed_order_is_the_claimed_one(method: type, counts: tuple[int, ...]) -> None:
    """At the ends of the steps and between them: the dense output has order eight."""
    errors = []
    for n in counts:
        h = 4.0 / n
        sol = hs.simulate(
            LINEAR, (0, 4), integrator=method.name, rtol=0.9, atol=1e9, max_step=h, first_step=h
        )
        times = np.linspace(0, 4, 4 * n + 1)
        assert sol.stats["steps"] == n
        errors.append(max(np.abs(sol(t) - motion(t)).max() for t in times))
    orders = [math.log2(a / b) for a, b in pairwise(errors)]
    assert orders[-1] == pytest.approx(method.tableau.order, abs=0.3), (errors, orders)


@pytest.mark.parametrize("method", BOTH)
@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8, 1e-10])
def test_the_error_follows_the_tolerance(method: type, rtol: float) -> None:
    sol = hs.simulate(LINEAR, (0.0, 20.0), integrator=method.name, rtol=rtol, atol=rtol)
    times = np.linspace(0, 20, 301)
    error = max(np.abs(sol(t) - motion(t)).max() for t in times)
    assert rtol * 1e-3 < error < 100 * rtol
