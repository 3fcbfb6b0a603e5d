"""A potential that has a pole in time: near its peak an ulp of time moves it, so a step ends where it was tried."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from scipy.integrate import quad

import hybridsim as hs

NEURON = {"C": 281.0, "g": 30.0, "E": -70.6, "VT": -50.4, "D": 2.0, "I": 1000.0}
RATE = "(-g*(V - E) + g*D*exp((V - VT)/D) + I)/C"


def neuron(peak: float) -> hs.Model:
    """An adaptive exponential neuron without adaptation: at its peak the potential is set back."""
    spike = hs.Guard("spike", "peak - V", then=(hs.Choice("up", reset={"V": "E"}),))
    return hs.Model(
        "neuron",
        states=[hs.State("V", "E", der=RATE)],
        parameters=NEURON | {"peak": peak},
        components=[hs.Component("c", [hs.Mode("up", guards=[spike])])],
    )


def time_to(peak: float) -> float:
    """The time that a rise takes, by quadrature over the potential."""
    at = dict(NEURON)

    def time_per_volt(V: float) -> float:
        drive = at["g"] * at["D"] * math.exp((V - at["VT"]) / at["D"]) + at["I"]
        return at["C"] / (drive - at["g"] * (V - at["E"]))

    marks = [at["E"], -60.0, -52.0, -48.0, -44.0, -40.0, -30.0, -15.0, peak]
    return sum(quad(time_per_volt, a, b, epsrel=1e-13, epsabs=0)[0] for a, b in pairwise(marks))


@pytest.mark.parametrize("peak", [0.0, 8.0, 14.0])
@pytest.mark.parametrize("integrator", ["taylor", "dop853", "tsit5", "rodas5p"])
def test_a_neuron_runs_to_its_peak(integrator: str, peak: float) -> None:
    """Three spikes, each as long after the one before it."""
    period = time_to(peak)
    sol = hs.simulate(neuron(peak), (0, 3.5 * period), integrator=integrator, rtol=1e-9)
    assert sol.status == "finished", sol.message
    spikes = [event.t for event in sol.events if event.kind == "transition"]
    assert spikes == pytest.approx([period, 2 * period, 3 * period], abs=1e-6)


def test_a_step_ends_at_a_double() -> None:
    """At the one next to where it was to end; one of a few ulps of time is no longer than was asked for."""
    from hybridsim.engine.native.time_grid import on_the_grid

    for s in (0.0, 1.0, 11.75, 1e300, 3.3e-5):
        for share in (0.3, 0.6, 1.0, 1.4, 1.6, 2.5, 1e3 + 0.7, 5e3 + 0.7, 1e16):
            for sign in (1.0, -1.0):
                h = sign * share * (math.ulp(s) if s else 1e-9)
                moved = on_the_grid(s, h)
                assert (s + moved) - s == moved and moved * h >= 0.0
                if share > 4e3:
                    assert s + moved == s + h
                else:
                    assert abs(moved) <= abs(h)
                    assert share < 3.0 or abs(moved) >= abs(h) - 2.0 * math.ulp(s + h)


@pytest.mark.parametrize("integrator", ["dop853", "tsit5"])
@pytest.mark.parametrize("count", [10, 40, 97, 500, 1000])
@pytest.mark.parametrize("span", [4.0, 0.3])
def test_steps_of_one_length_fill_the_span(integrator: str, count: int, span: float) -> None:
    """No further step of some ulps follows the last."""
    model = hs.Model("decay", states=[hs.State("x", 1.0, der="-x")])
    h = span / count
    sol = hs.simulate(model, (0, span), integrator=integrator, rtol=0.9, atol=1e9, max_step=h, first_step=h)
    assert sol.stats["steps"] == count
