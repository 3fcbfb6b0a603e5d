"""What Runge-Kutta methods say between their steps, where the flow bends sharply just beyond the end of one."""

from __future__ import annotations

import numpy as np
import pytest

import hybridsim as hs

BENDS = [(1.1, 2.0, 0.4, 0.01), (0.83, 1.3, 0.6, 0.002), (1.43, 2.6, 0.3, 0.03)]


def smoothed(w: float, load: float, mu: float, v0: float, *monitors: hs.Monitor) -> hs.Model:
    """A driven oscillator with dry friction smoothed over a velocity."""
    return hs.Model(
        "smoothed",
        parameters={"w": w, "F": load, "mu": mu, "v0": v0},
        states=[
            hs.State("x", 0, "v", nominal=1),
            hs.State("v", 0, "F*sin(w*t) - x - 0.05*v - mu*tanh(v/v0)", nominal=1),
        ],
        monitors=list(monitors),
    )


@pytest.mark.parametrize("integrator", ["dop853", "tsit5"])
@pytest.mark.parametrize("is_compiled", [True, False])
@pytest.mark.parametrize("bend", BENDS)
def test_they_hold_between_steps(
    bend: tuple[float, float, float, float], is_compiled: bool, integrator: str
) -> None:
    """A step that ends before the bend was right there and 1e-2 off inside of it."""
    far = () if is_compiled else (hs.Monitor("far", "x - 1e3"),)  # which takes the general mode loop
    model, end = smoothed(*bend, *far), 60.0 if is_compiled else 15.0
    times = np.linspace(0.0, end, 20011)
    exact = hs.simulate(model, (0.0, end), integrator="taylor", rtol=1e-13)(times)
    found = hs.simulate(model, (0.0, end), integrator=integrator, rtol=1e-9)(times)
    assert abs(found - exact).max() < 1e-6


def test_it_holds_without_a_bend_too() -> None:
    """No step is turned down where the flow is smooth."""
    for integrator, rtol in (("dop853", 1e-9), ("dop853", 1e-4), ("tsit5", 1e-6)):
        sol = hs.simulate("dfcs", (0.0, 1.0), integrator=integrator, rtol=rtol)
        assert sol.stats["rejected"] <= 0.06 * sol.stats["steps"]


@pytest.mark.parametrize("hardness", [4e5, 1e7])
def test_rodas5p_holds_between_steps_where_a_wave_draws_the_state_to_itself(hardness: float) -> None:
    """The motion is the waves; without a look at the middle of a step the output was 2.4e-4 off at rtol 1e-6."""
    waves = {
        "w0": 0.6868887202472337,
        "w1": 0.6995540468015224,
        "w2": 2.532731585249471,
        "w3": 3.7470495071742436,
    }
    apart = [f"(x{i} - sin(w{i}*t))" for i in range(4)]
    drawn = [
        f"atan({apart[0]}) + 0.25*{apart[1]}",
        f"L*(atan({apart[1]}) + 0.25*sin({apart[2]}))",
        f"0.1*L*(tanh({apart[2]}) + 0.25*atan({apart[3]}))",
        f"0.8*L*({apart[3]} + {apart[3]}**3 + 0.25*{apart[0]})",
    ]
    model = hs.Model(
        "drawn",
        parameters={**waves, "L": hardness},
        states=[hs.State(f"x{i}", 0, f"w{i}*cos(w{i}*t) - ({pull})") for i, pull in enumerate(drawn)],
    )
    times = np.linspace(0.0, 2.0, 4001)
    found = hs.simulate(model, (0.0, 2.0), integrator="rodas5p", rtol=1e-6, atol=1e-9)(times)
    assert abs(found - np.sin(np.outer(list(waves.values()), times))).max() < 1e-4
