"""Motions that never come back, and closed orbits that neither attract nor repel."""

import numpy as np
import pytest

import hybridsim as hs


@pytest.mark.parametrize("rate", ["1", "1e-9", "-3"])
def test_a_state_that_only_adds_up_is_no_steady_state(rate):
    found = hs.steady_state(hs.Model("drift", states=[hs.State("x", 0.0, rate)]))
    assert not found.success
    assert "x does not return" in found.message


@pytest.mark.parametrize("rate", ["1", "0.3 + x"])
@pytest.mark.parametrize("integrator", ["exact", "dop853"])
def test_one_that_adds_up_beside_one_that_comes_to_rest_is_named(rate, integrator):
    states = [hs.State("x", 1.0, "v"), hs.State("v", 0.0, "-x - 0.1*v"), hs.State("th", 0.0, rate)]
    found = hs.steady_state(hs.Model("shaft", states=states), integrator=integrator)
    assert not found.success
    assert "th does not return" in found.message


@pytest.mark.parametrize(
    "rates",
    [("y", "-sin(x)"), ("x*(1 - y)", "y*(x - 1)"), ("y", "-x - x**3")],
    ids=["pendulum", "Lotka", "Duffing"],
)
def test_closed_orbits_of_what_conserves_energy_are_neutral(rates):
    """Both multipliers are 1: the one along the motion, and by Liouville's theorem the other."""
    start = 0.0 if rates[0] == "y" else 1.0
    model = hs.Model("orbit", states=[hs.State("x", 2.0, rates[0]), hs.State("y", start, rates[1])])
    found = hs.steady_state(model)
    assert found.success
    np.testing.assert_allclose(found.multipliers, [1.0], atol=1e-8)
    assert found.stable
