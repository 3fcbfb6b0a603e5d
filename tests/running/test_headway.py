"""Runs that come forward too slowly end by themselves, and where stiffness begins on the way a stiff method goes on."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import hybridsim as hs


def falling(t: float, x: Any, p: Any) -> Any:
    """Rates in Python, in which nobody sees the jump."""
    return (-(abs(x[0]) ** 0.5) if x[0] > 0.2 else abs(x[0]) ** 0.5,)


def rubbing(t: float, x: Any, p: Any) -> Any:
    """A spring with a friction that jumps with the velocity, and is small."""
    return (x[1], -x[0] - (0.001 if x[1] > 0.0 else -0.001))


CRAWLING = hs.Model("crawling", states={"x": 1.0}, flow=falling)


@pytest.mark.parametrize("rtol", [1e-9, 1e-7])
@pytest.mark.parametrize("integrator", ["auto", "tsit5"])
def test_a_motion_that_crawls_along_a_jump_ends(integrator: str, rtol: float) -> None:
    """Both sides drive it back into x = 0.2, which no field on the surface is declared for; limits do not matter."""
    limits = {"seconds": 1e6, "steps": 1e12}
    sol = hs.simulate(CRAWLING, (0, 1000), integrator=integrator, rtol=rtol, limits=limits)
    assert sol.status == "step-failure" and "no progress" in sol.message and "[surfaces.NAME]" in sol.message
    assert sol.t_end == pytest.approx(2 * (1 - math.sqrt(0.2)), abs=0.1) and sol.stats["steps"] < 40_000


def test_a_motion_through_jumps_goes_on() -> None:
    """They are crossed again and again; that is no crawling."""
    model = hs.Model("jumps", states={"x": 0.5, "v": 0.0}, flow=rubbing)
    sol = hs.simulate(model, (0, 100), integrator="dop853", rtol=1e-6)
    assert sol.status == "finished" and sol.stats["steps"] > 300


def test_events_that_come_ever_more_closely_end_the_run() -> None:
    """A relay with a lag turns about its point of rest ever faster, and never comes there: t goes like log(events)."""
    states = [hs.State("x", 0.5, der="-sign(y)"), hs.State("y", 0, der="5*(x - y)")]
    sol = hs.simulate(hs.Model("relay", states=states), (0, 60), integrator="dop853", rtol=1e-6)
    assert sol.status == "step-failure" and "no progress" in sol.message and "hysteresis" in sol.message
    assert abs(sol.y[0, -1]) < 1e-4 and sol.t_end > 5.0


def test_a_method_that_would_take_ages_ends() -> None:
    """x' = -1e13 (x - cos(t)): an explicit method takes some 1e12 steps for one unit of time."""
    model = hs.Model("stiff", states=[hs.State("x", 1, der="-1e13*(x - cos(t))")])
    sol = hs.simulate(model, (0, 1), integrator="dop853")
    assert sol.status == "step-failure" and "no progress" in sol.message and "rodas5p" in sol.message
    assert sol.stats["steps"] < 5_000_000
    assert hs.simulate(model, (0, 1)).y[0, -1] == pytest.approx(math.cos(1), abs=1e-9)


def test_stiffness_that_begins_on_the_way() -> None:
    """x = cos(t), and what drives it back there grows from 1 to 1e6 while nothing of it shows at the start."""
    states = [hs.State("x", 1, der="-(1 + 1e3*z)*(x - cos(t)) - sin(t)"), hs.State("z", 0, der="1")]
    model = hs.Model("later", states=states, parameters={})
    sol = hs.simulate(model, (0, 1000), rtol=1e-8)
    assert sol.status == "finished" and "with rodas5p, because stability" in sol.message
    assert sol.integrator == "dop853" and not any(text.startswith("stiff") for text in sol.warnings)
    times = np.linspace(0.0, 1000.0, 501)
    assert sol(times)[0] == pytest.approx(np.cos(times), abs=1e-5)
    assert sol.stats["steps"] < 200_000


def test_robertson_over_ages() -> None:
    """The values of E. Hairer and G. Wanner 1996, section IV.10, and what is left of the sum is 1."""
    states = [
        hs.State("a", 1, der="-0.04*a + 1e4*b*c"),
        hs.State("b", 0, der="0.04*a - 1e4*b*c - 3e7*b**2"),
        hs.State("c", 0, der="3e7*b**2"),
    ]
    sol = hs.simulate(hs.Model("robertson", states=states), (0, 4e7))
    assert sol.status == "finished" and "rodas5p" in sol.message
    assert sol.y[:, -1].sum() == pytest.approx(1.0, abs=1e-9)
    late = sol(4e7)
    # slow manifold: c = 1 - a - b and b = a*0.04/(1e4 c), so that a' = -0.04 a + 1e4 b c = -3e7 b**2
    assert late[1] == pytest.approx(0.04 * late[0] / (1e4 * late[2]), rel=1e-3)


def converter(snubber: str) -> hs.Model:
    """A filter that a square wave feeds, with a snubber that is far faster."""
    states = [
        hs.State("i", 0, der="(u - R*i - v)/L", nominal=1),
        hs.State("v", 0, der="(i - v/load - j)/C", nominal=1),
        hs.State("w", 0, der="j/Cs", nominal=1),
        hs.State("j", 0, der=snubber, nominal=1),
    ]
    return hs.Model(
        "converter",
        states=states,
        parameters={"R": 0.1, "L": 1e-4, "C": 1e-4, "load": 10, "Rs": 1, "Cs": 1e-8, "Ls": 1e-8},
        inputs=[hs.Input("u", "wave", shape="square", amplitude=12, period=1e-4)],
    )


def test_a_stiff_converter_with_a_wave_is_stiff_from_the_start() -> None:
    """The explicit method would need about 15000 steps: `auto` takes the stiff method."""
    sol = hs.simulate(converter("(v - w - Rs*j)/Ls"), (0, 1e-3), rtol=1e-6)
    assert sol.status == "finished" and sol.integrator == "rodas5p"
    assert sol.stats["steps"] < 4000


def test_what_decays_as_fast_as_it_turns_is_stiff() -> None:
    """The eigenvalues of the snubber are a pair, -0.5e8 (1 +- 1.7j), which no power method settles on."""
    sol = hs.simulate(converter("(v - w - Rs*j)/Ls"), (0, 1e-3), integrator="dop853", rtol=1e-6)
    assert any(text.startswith("stiff") for text in sol.warnings)


def test_a_damped_oscillator_is_not_stiff() -> None:
    """Nothing is far faster than the rest: a long run stays with the explicit method."""
    states = [hs.State("x", 1, der="v"), hs.State("v", 0, der="-x - 0.2*v - 0.1*x**3 + cos(t)")]
    crossing = [hs.Monitor("zero", "x", direction="up", action="record")]
    sol = hs.simulate(hs.Model("damped", states=states, monitors=crossing), (0, 2000), rtol=1e-6)
    assert sol.integrator == "dop853" and "rodas5p" not in sol.message
