"""The first step after a known time is that of the motion, however close an event is before it."""

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
