"""Multistep solvers: values between stiff steps are those of the slow motion, and a first step is not far too long."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.integrators.past_steps import converges, through


@pytest.mark.parametrize("v0", [1e-5, 1e-7])
@pytest.mark.parametrize("integrator", ["cvode-bdf", "scipy-radau", "scipy-bdf", "scipy-lsoda"])
def test_creep_between_the_steps(integrator: str, v0: float) -> None:
    """mu N tanh(v/v0) balances the load, the body being all but at rest: v = v0 artanh(F0 sin(w t)/(mu N))."""
    model = hs.load("dfcs").regularized("tanh", v0=v0)
    p = model.parameter_values()
    release = math.asin(p["mu"] * p["N"] / p["F0"]) / p["omega"]
    sol = hs.simulate(model, (0, 0.9 * release), integrator=integrator, rtol=1e-8)
    times = np.linspace(0.1 * release, 0.89 * release, 2003)
    creep = v0 * np.arctanh(p["F0"] * np.sin(p["omega"] * times) / (p["mu"] * p["N"]))
    # the spring takes k x of the load: k v0 t/(mu N), some 1e-4 of it for the larger v0
    assert np.max(np.abs(sol(times)[1] / creep - 1)) < 2e-3


def test_a_polynomial_through_the_last_steps() -> None:
    s = np.array([0.0, 0.1, 0.25, 0.5, 0.6, 1.0])
    x = np.stack([s**5 - s, np.sin(s)], axis=1)
    found = through(s, x)(np.array([0.6, 0.7, 0.9, 1.0]))
    at = np.array([0.6, 0.7, 0.9, 1.0])
    assert found[:, 1] == pytest.approx(np.sin(at), abs=1e-5)  # |prod (s - s_k)|/6! is at most 8e-6 here
    assert found[-1].tolist() == x[-1].tolist()
    line = through(s[:2], x[:2])(np.array([0.05]))
    assert line[0, 1] == pytest.approx(math.sin(0.1) / 2)


def test_a_series_that_does_not_reach_the_other_end() -> None:
    h = 0.1
    smooth = np.array([[1.0, -1.0, 0.5, -1 / 6]])
    assert converges(smooth, h, np.exp([-h]))
    stiff = np.array([[1.0, -1e-6 * 1e4, 1e-6 * 1e8 / 2, -1e-6 * 1e12 / 6]])
    assert not converges(stiff, h, np.array([0.999999]))


@pytest.mark.parametrize("periods", [20, 100])
def test_lsoda_is_not_sent_off_with_a_step_as_long_as_the_stick_before(periods: int) -> None:
    """Its first step comes from the series of the states: one far too long made it give up at a release."""
    model = hs.load("dfcs")
    period = 2 * math.pi / model.parameter_values()["omega"]
    for rtol in (1e-4, 1e-8):
        sol = hs.simulate(model, (0, periods * period), integrator="scipy-lsoda", rtol=rtol)
        assert sol.success, sol.message
        assert len(sol.events) == 4 * periods + 1


@pytest.mark.parametrize("name", ["cvode-bdf", "cvode-adams"])
def test_a_gap_that_closes_and_opens_within_a_step(name: str) -> None:
    """x moves evenly over a floor that has a bump of a fiftieth of the way: it hits the bump where that begins."""
    ball = hs.Model(
        "bump",
        states=[hs.State("x", 0, 1), hs.State("h", 0, "w"), hs.State("w", 0, "p")],
        impacts=[hs.Impact("p", gap="h + (x - 5)**2 - 0.01", restitution=1)],
    )
    sol = hs.simulate(ball, (0.0, 10.0), integrator=name)
    assert sol.success, sol.message
    # the gap falls at 0.2 where it closes, and w becomes 2*0.2 of it: h + (t - 5)**2 >= 0.01 from then on
    assert [event.t for event in sol.events] == [pytest.approx(4.9, abs=1e-9)]
    assert sol(10.0) == pytest.approx([10.0, 0.4 * 5.1, 0.4], abs=1e-6)
