"""One over a sum with an exponential, and over a hyperbolic cosine, far beyond where the exponential is infinite."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

import hybridsim as hs

BY_SERIES = ("taylor", "rodas5p")  # what takes derivatives of rates


def final(rate: str, start: float, end: float, integrator: str) -> float:
    """Where a single state ends."""
    sol = hs.simulate(hs.Model("one", [hs.State("x", start, rate)]), (0, end), integrator=integrator)
    assert sol.success, sol.message
    return float(sol.y[0, -1])


@pytest.mark.parametrize("integrator", BY_SERIES)
@pytest.mark.parametrize("w", [0.1, 1e-3, 1e-4])
def test_a_motion_that_switches_itself_off(integrator: str, w: float) -> None:
    """x' = 1/(1 + e^(x/w)): x + w e^(x/w) grows as time does; and its mirror image."""

    def rest(x: float) -> float:
        return x + w * math.exp(x / w) - (-1.0 + w * math.exp(-1.0 / w) + 3.0)

    wanted = brentq(rest, -1.0, 1.0 if w == 0.1 else 30.0 * w, xtol=1e-15)
    assert final(f"1/(1 + exp(x/{w}))", -1.0, 3.0, integrator) == pytest.approx(wanted, abs=1e-8)
    assert final(f"-1/(exp(-x/{w}) + 1)", 1.0, 3.0, integrator) == pytest.approx(-wanted, abs=1e-8)


@pytest.mark.parametrize("integrator", BY_SERIES)
@pytest.mark.parametrize("rate", ["1/(1 + exp(x/1e-3))", "x/cosh(x/1e-3)**2", "1/(2 + 3*exp(1e4*x))**3"])
def test_a_motion_that_is_off(integrator: str, rate: str) -> None:
    """Where the exponential is infinite the rate is nothing."""
    assert final(rate, 1.0, 3.0, integrator) == 1.0


@pytest.mark.parametrize("integrator", BY_SERIES)
@pytest.mark.parametrize("w", [0.1, 1e-3, 1e-5])
def test_switched_by_time(integrator: str, w: float) -> None:
    """A load that goes on, with factors, and a pulse; both integrals are known."""
    c, d = 3.0, 2.0
    # of 1/(c + d e^u): (t - w log(c + d e^u))/c
    grown = w * (np.logaddexp(np.log(c), np.log(d) + 5.0 / w) - np.logaddexp(np.log(c), np.log(d) - 5.0 / w))
    assert final(f"4/(3 + 2*exp((t - 5)/{w}))", 0.0, 10.0, integrator) == pytest.approx(
        4.0 * (10.0 - grown) / c, abs=1e-7
    )
    if integrator == "taylor":  # the other one steps over pulses that are shorter than its steps
        assert final(f"1/cosh((t - 5)/{w})**2", 0.0, 10.0, integrator) == pytest.approx(
            2.0 * w * math.tanh(5.0 / w), rel=1e-8, abs=1e-11
        )


@pytest.mark.parametrize("integrator", BY_SERIES)
def test_an_event_of_a_saturated_guard(integrator: str) -> None:
    """The guard is 0.9 less a smooth step at x = 1 of width w: zero at x = 1 + w log 9."""
    w = 1e-4
    guard = hs.Guard("reached", f"0.9 - 1/(1 + exp(-(x - 1)/{w}))", "after")
    model = hs.Model(
        "relay",
        [hs.State("x", 0.0, "1"), hs.State("y", 0.0, "0")],
        components=[
            hs.Component(
                "r", [hs.Mode("before", guards=[guard]), hs.Mode("after", der={"y": "1"})], initial="before"
            ),
        ],
    )
    sol = hs.simulate(model, (0, 3), integrator=integrator)
    assert sol.success, sol.message
    assert sol.event_times("r").tolist() == pytest.approx([1.0 + w * math.log(9.0)], abs=1e-9)
    assert sol.y[1, -1] == pytest.approx(2.0 - w * math.log(9.0), abs=1e-8)


def test_it_is_no_corner() -> None:
    """What is chosen by the sign of u is one function on both sides."""
    model = hs.Model("one", [hs.State("x", -1.0, "1/(1 + exp(x/0.1))")])
    assert "corner" not in hs.simulate(model, (0, 1), integrator="taylor").message
    exact = hs.simulate(model, (0, 3), integrator="taylor", rtol=1e-12)
    assert hs.simulate(model, (0, 3), integrator="dop853", rtol=1e-12).y[0, -1] == pytest.approx(
        exact.y[0, -1], abs=1e-10
    )
