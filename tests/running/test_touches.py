"""Guards that touch zero, or are zero throughout, do not fire, however the steps are rounded."""

from __future__ import annotations

import random

import pytest

import hybridsim as hs

METHODS = ("exact", "taylor", "dop853", "tsit5", "rodas5p", "scipy-dop853", "scipy-radau", "cvode-bdf")


def watching(name: str, guard: str, parameters: dict[str, float], states: list[hs.State]) -> hs.Model:
    """A model that counts in n how often a guard fires."""
    mode = hs.Mode("on", guards=[hs.Guard("g", guard, then=[hs.Choice("on", reset={"n": "n + 1"})])])
    return hs.Model(
        name,
        parameters=parameters,
        states=states,
        discrete=[hs.Discrete("n", 0)],
        components=[hs.Component("c", modes=[mode], initial="on")],
    )


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize("guard", ["a*T**2/2 + y0 - y", "3*(a*T**2/2 + y0) - 3*y"])
def test_the_top_of_a_parabola_is_no_event(integrator: str, guard: str) -> None:
    """y = y0 + a*T*t - a*t**2/2 has its top at T; q only makes the steps short."""
    draw = random.Random(5)
    for _ in range(8):
        top, steepness, start = draw.uniform(0.3, 1.3), draw.uniform(0.5, 2.0), draw.uniform(-1.0, 1.0)
        states = [hs.State("y", "y0", "v"), hs.State("v", "a*T", "-a"), hs.State("q", 1, "-q")]
        model = watching("top", guard, {"T": top, "a": steepness, "y0": start}, states)
        sol = hs.simulate(model, (0.0, top * draw.uniform(1.2, 3.0)), integrator=integrator)
        assert sol.success and sol.output("n", sol.t_end) == 0.0, sol.message


@pytest.mark.parametrize("integrator", METHODS)
def test_a_dip_beyond_the_rounding_of_the_steps_is_an_event(integrator: str) -> None:
    """The top is higher by a 10^-10 part: the guard is zero at T - sqrt(2*high/a), and y goes on from zero."""
    draw = random.Random(8)
    for _ in range(6):
        top, steepness = draw.uniform(0.3, 1.3), draw.uniform(0.5, 2.0)
        high = 1e-10 * steepness * top**2 / 2.0
        states = [hs.State("y", 0, "v"), hs.State("v", "a*T", "-a"), hs.State("q", 1, "-q")]
        parameters = {"T": top, "a": steepness, "high": high}
        mode = hs.Mode("on", guards=[hs.Guard("g", "a*T**2/2 - high - y", then="off")])
        switch = hs.Component("c", modes=[mode, hs.Mode("off")], initial="on")
        model = hs.Model("dip", parameters=parameters, states=states, components=[switch])
        sol = hs.simulate(model, (0.0, 1.2 * top), integrator=integrator, rtol=1e-12)
        changes = [event.t for event in sol.events if event.kind == "transition"]
        assert changes == [pytest.approx(top - (2.0 * high / steepness) ** 0.5, rel=1e-6)]


@pytest.mark.parametrize("integrator", METHODS)
def test_a_guard_that_is_zero_throughout_is_no_event(integrator: str) -> None:
    """x - c and y move in proportion, in steps that round each of them by itself."""
    draw = random.Random(6)
    for _ in range(8):
        parameters = {"k": draw.uniform(0.3, 3.0), "m": draw.uniform(0.3, 3.0), "c": draw.uniform(-1.0, 1.0)}
        states = [hs.State("x", "c", "k*w"), hs.State("y", 0, "m*w"), hs.State("w", 1, "-w + sin(3*t)")]
        model = watching("zero", "m*(x - c) - k*y", parameters, states)
        sol = hs.simulate(model, (0.0, 3.0), integrator=integrator)
        assert sol.success and sol.output("n", 3.0) == 0.0, sol.message
