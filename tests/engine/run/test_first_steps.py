"""The first step of a segment has the length that the motion needs, whatever happens just before or after it."""

from __future__ import annotations

import pytest

import hybridsim as hs

EVENT = 2.0**-20


def steps_with_knot(after: float, integrator: str) -> int:
    """Steps of a run with one event, and a knot of an input at some time after it."""
    model = hs.Model.from_toml(f"""
schema = 1
name = "switched"
[states]
clock = {{ start = {-EVENT!r}, der = "1" }}
x = {{ start = 1, der = "-100*x + u + power" }}
[inputs]
u = {{ kind = "table", times = [0, {EVENT + after!r}, 1], values = [0, 0, 1] }}
[components.heater.modes.off]
initial = true
set = {{ power = "0" }}
guards.up = {{ expr = "-clock", then = "on" }}
[components.heater.modes.on]
set = {{ power = "1" }}
""")
    sol = hs.simulate(model, (0, 0.02), integrator=integrator)
    assert sol.status == "finished" and [event.source for event in sol.events] == ["off"]
    steps: int = sol.stats["steps"]
    return steps


@pytest.mark.parametrize("integrator", ["scipy-rk45", "rodas5p"])
def test_a_knot_just_after_an_event_costs_one_step(integrator: str) -> None:
    far = steps_with_knot(0.1, integrator)
    assert [steps_with_knot(after, integrator) - far for after in (1e-18, 1e-16)] == [1, 1]


@pytest.mark.parametrize(
    ("rtol", "share"), [(1e-6, 0.03), (1e-6, 0.3), (1e-9, 0.03), (1e-9, 0.3), (1e-12, 0.3)]
)
@pytest.mark.parametrize("integrator", ["scipy-lsoda", "scipy-bdf", "cvode-adams", "cvode-bdf"])
def test_a_rise_below_the_tolerance_is_no_series_of_events(
    integrator: str, rtol: float, share: float
) -> None:
    """c - 8 = b*t*(2*p - t) rises from a corner's zero for a time p. A step of order one falls there."""
    bend, end = 158.0, 0.5
    p = share * (8 * rtol / bend) ** 0.5  # the height b*p**2 is share**2 of the tolerance of c
    model = hs.Model.from_toml(f"""
schema = 1
name = "rise"
[states]
c = {{ start = 8, der = "2*{bend!r}*({p!r} - t)" }}
y = {{ start = 0, der = "abs(c - 8)" }}
""")
    sol = hs.simulate(model, (0, end), integrator=integrator, rtol=rtol)
    assert sol.status == "finished"
    assert sol.stats["restarts"] <= 3  # the start, and the one crossing at 2*p
    truth = bend * (end**3 / 3 - p * end**2 + 8 / 3 * p**3)
    assert sol(end)[1] == pytest.approx(truth, rel=20 * rtol)
