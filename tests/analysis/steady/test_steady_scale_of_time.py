"""Steady states without forcing find their scale of time, and say of a motion without bound that it has none."""

from __future__ import annotations

import math
import warnings

import pytest

import hybridsim as hs


def relaxation(rate: str, level: float) -> hs.Model:
    again = hs.Choice("on", reset={"x": 0})
    on = hs.Mode("on", hs.Guard("full", f"{level!r} - x", again))
    return hs.Model("relaxation", [hs.State("x", 0, rate)], components=[hs.Component("c", [on], "on")])


@pytest.mark.parametrize(
    ("rate", "level", "period"),
    [
        ("(1 - x)/1e-4", 0.5, 1e-4 * math.log(2.0)),
        ("1e6", 0.5, 5e-7),
        ("(1 - x)/1e3", 0.5, 1e3 * math.log(2.0)),
    ],
)
def test_a_period_far_from_one(rate: str, level: float, period: float) -> None:
    found = hs.steady_state(relaxation(rate, level))
    assert (found.kind, found.multiple) == ("periodic", 1)
    assert found.period == pytest.approx(period, rel=1e-9)
    assert found.multipliers.size == 0


@pytest.mark.parametrize("der", ["0.1*v - x", "0.1*v - x + sin(t)", "50*x"])
@pytest.mark.parametrize("integrator", ["auto", "taylor"])
def test_a_motion_without_bound_ends_by_saying_so(der: str, integrator: str) -> None:
    states = [hs.State("x", 1.0, "v"), hs.State("v", 0.0, der)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = hs.steady_state(hs.Model("growing", states=states), integrator=integrator)
    assert found.kind == "not settled"
    assert "grows without bound" in found.message


def test_a_slow_decay_beside_a_fast_one_is_no_rest_too_soon() -> None:
    """What is cut short by its cost says nothing of what is slow: y turns slowly, x follows it at once."""
    states = [hs.State("x", 0.0, "1e3*(y - x)"), hs.State("y", 1.0, "w"), hs.State("w", 0.0, "-1e-2*y")]
    found = hs.steady_state(hs.Model("stiff", states=states), max_periods=64)
    assert found.kind != "equilibrium"


def test_two_forcings_without_a_common_period_may_drive_a_motion_without_bound() -> None:
    found = hs.steady_state(
        hs.Model("growing", states=[hs.State("x", 1.0, "x + sin(t) + sin(sqrt(2)*t)")]), max_periods=4096
    )
    assert found.kind == "not settled" and "grows without bound" in found.message


def test_an_interruption_ends_the_search_and_not_one_run_of_it() -> None:
    calls = []

    def interrupted(share: float) -> None:
        calls.append(share)
        raise KeyboardInterrupt

    states = [hs.State("x", 0.5, "v"), hs.State("v", 0.0, "(1 - x**2)*v - x + 0.1*v**3*(1 - v**2)")]
    with pytest.raises(KeyboardInterrupt):
        hs.steady_state(hs.Model("cycle", states=states), progress=interrupted, integrator="taylor")
    assert len(calls) == 1
