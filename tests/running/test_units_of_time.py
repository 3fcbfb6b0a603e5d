"""Motions in other units of time: the same to the same digits, whether time is in ages or in attoseconds."""

from __future__ import annotations

import math
import warnings

import pytest

import hybridsim as hs


@pytest.mark.parametrize("omega", [1e-20, 1e-12, 1.0, 1e11, 1e14, 1e20])
@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "tsit5", "rodas5p"])
def test_an_oscillator_with_a_monitor(integrator: str, omega: float) -> None:
    """Its zeros are at (k + 1/2) pi/omega; nothing warns."""
    model = hs.Model(
        "oscillator",
        states=[hs.State("x", 1, der="v"), hs.State("v", 0, der="-omega**2*x", nominal=omega)],
        parameters={"omega": omega},
        monitors=[hs.Monitor("zero", "x", direction="both", action="record")],
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sol = hs.simulate(model, (0, 20 / omega), integrator=integrator, rtol=1e-9)
    assert sol.status == "finished", sol.message
    expected = [(k + 0.5) * math.pi for k in range(6)]
    assert [event.t * omega for event in sol.events] == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize("omega", [1e-20, 1e14])
@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_an_oscillator_with_a_guard(integrator: str, omega: float) -> None:
    """A spring that is twice as stiff on one side."""
    stiff = hs.Mode("pushed", guards=[hs.Guard("g", "-x", "pulled")], der={"v": "-4*omega**2*x"})
    soft = hs.Mode("pulled", guards=[hs.Guard("g", "x", "pushed")], der={"v": "-omega**2*x"})
    model = hs.Model(
        "two-springs",
        states=[hs.State("x", 1, der="v"), hs.State("v", 0, der="0", nominal=omega)],
        parameters={"omega": omega},
        components=[hs.Component("c", [soft, stiff], initial="pulled")],
    )
    sol = hs.simulate(model, (0, 10 / omega), integrator=integrator, rtol=1e-9)
    assert sol.status == "finished", sol.message
    expected = [0.5 * math.pi, math.pi, 2.0 * math.pi, 2.5 * math.pi]
    assert [event.t * omega for event in sol.events] == pytest.approx(expected, abs=1e-7)
