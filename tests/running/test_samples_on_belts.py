"""Resets read the velocity of a body that sticks to a belt as it is before the belt's speed jumps."""

from __future__ import annotations

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.reference.multiple_precision import multiple_precision_trajectory

BODY = """
[states]
v = {{ start = 0.2, der = "-f" }}
y = {{ start = 0, der = 1 }}
[discrete]
read = 0
w = 0.2
[contacts.f]
velocity = "v - {belt}"
normal = 1
law = {{ name = "coulomb", mu = 0.5 }}
"""
BELTS = {
    "step": ("(0.2 if t < 1.5 else -0.3)", ""),
    "table": (
        "b",
        '[inputs.b]\nkind = "table"\ntimes = [0, 1.5, 1.5, 4]\nvalues = [0.2, 0.2, -0.3, -0.3]\n',
    ),
    "reset": ("w", "[schedules.s]\ntimes = [1.5]\nreset = { w = -0.3 }\n"),
}
SAMPLES = {
    "clock": '[clocks.c]\nperiod = 0.75\nset = { read = "v" }\n',
    "condition": """
[components.a]
initial = "on"
[components.a.modes.on]
guards.g = { expr = "1.5 - y", then = [
  { when = "v > 0", to = "off", reset = { read = "v" } }, { to = "off", reset = { read = -1 } }] }
[components.a.modes.off]
""",
    "monitor": '[monitors.m]\nexpr = "y - 1.5"\naction = "reset"\nreset = { read = "v" }\n',
}


@pytest.mark.parametrize("sample", SAMPLES)
@pytest.mark.parametrize("belt", BELTS)
def test_a_sample_at_the_jump_of_a_belt(belt: str, sample: str) -> None:
    """The body has 0.2 until 1.5, and then slows down at a rate of 0.5."""
    speed, more = BELTS[belt]
    model = hs.Model.from_toml(BODY.format(belt=speed) + more + SAMPLES[sample])
    for integrator in ("exact", "taylor", "dop853", "tsit5", "rodas5p", "cvode-bdf"):
        run = hs.simulate(model, (0, 2.1), integrator=integrator)
        assert run.output("read", 1.6) == pytest.approx(0.2, abs=1e-12)
        assert run.output("v", 2.1) == pytest.approx(-0.1, abs=1e-7)


@pytest.mark.parametrize("sample", ["clock", "condition"])
def test_a_sample_in_multiple_precision(sample: str) -> None:
    belt, more = BELTS["table"]
    text = BODY.format(belt=belt).replace('"-f"', '"0.5*read - f"') + more + SAMPLES[sample]
    model = hs.Model.from_toml(text)
    run = hs.simulate(model, (0, 2.1), integrator="exact")
    assert run.output("v", 2.1) == pytest.approx(0.2 + 0.6 * (0.1 - 0.5), abs=1e-12)
    reference = multiple_precision_trajectory(model, (0, 2.1))
    assert reference.states.state(2.1)[0] == pytest.approx(0.2 + 0.6 * (0.1 - 0.5), abs=1e-12)


@pytest.mark.parametrize("integrator", ["taylor", "exact", "dop853"])
def test_an_unrelated_tick_beside_a_body_on_a_moving_floor(integrator: str) -> None:
    """The floor accelerates by 0.484 at most, gravity by 3.2: the body lies on it, whatever another state does."""
    omega = 2.2
    for k in range(12):
        period = 0.5 + 0.0371 * k
        body = hs.Model(
            "floor",
            parameters={"w0": omega},
            states=[
                hs.State("h", 0, "w"),
                hs.State("w", 0.1 * omega, "p - 3.2"),
                hs.State("x", 0.4, 0.7),
            ],
            impacts=[hs.Impact("p", gap="h - 0.1*sin(w0*t)", restitution=0)],
            schedules=[hs.Schedule("clock", start=period, period=period, reset={"x": 0.4})],
        )
        sol = hs.simulate(body, (0.0, 6.0), integrator=integrator)
        assert sol.success, (period, sol.message)
        assert [mode.mode for mode in sol.modes["p"]] == ["closed"]
        assert {event.component for event in sol.events} == {"clock"}
        times = np.linspace(0.0, 6.0, 50)
        assert sol(times)[0] == pytest.approx(0.1 * np.sin(omega * times), abs=1e-15)
