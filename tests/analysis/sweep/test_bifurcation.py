"""Bifurcation diagrams: sections of motions that are known in closed form, both branches of a hysteresis."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.analysis.sweep.section import repeats_after

OSCILLATOR = hs.Model(
    "forced",
    parameters={"d": 0.4, "k": 4.0, "a": 1.0, "w": 1.0},
    states=[hs.State("x", 0, "v", nominal=1.0), hs.State("v", 0, "a*sin(w*t) - d*v - k*x", nominal=1.0)],
)
WELLS = hs.Model(
    "two-wells",
    parameters={"b": 0.0, "a": 0.0},
    states=[hs.State("x", -1, "x - x**3 + b + a*sin(t)", nominal=1.0)],
)
CIRCLE = hs.Model(
    "circle",
    parameters={"r": 1.0},
    states=[
        hs.State("x", 1, "-y + x*(r - x**2 - y**2)", nominal=1.0),
        hs.State("y", 0.1, "x + y*(r - x**2 - y**2)", nominal=1.0),
    ],
)


def test_once_a_period_of_a_linear_oscillator() -> None:
    frequencies = [2.5, 0.7, 1.3]
    found = hs.bifurcation(OSCILLATOR, "w", frequencies, settle=60, samples=5)
    assert found.axes["w"].tolist() == sorted(frequencies) and found["x"].shape == (2, 3, 5)
    for k, w in enumerate(sorted(frequencies)):
        response = 1.0 / (4.0 - w * w + 0.4j * w)  # of exp(i w t); the forcing is its imaginary part
        assert found["x"][:, k] == pytest.approx(np.full((2, 5), response.imag), abs=2e-8)
        assert found["v"][:, k] == pytest.approx(np.full((2, 5), (1j * w * response).imag), abs=2e-8)
    assert (found["repeats_after"] == 1).all()


def test_hysteresis_shows_as_two_branches() -> None:
    """x' = x - x^3 + b rests at two places for |b| < 2/(3 sqrt 3); each branch leaves one at its own end."""
    b = np.linspace(-0.6, 0.6, 13)
    fold = 2.0 / (3.0 * math.sqrt(3.0))
    found = hs.bifurcation(WELLS, "b", b, section=None, settle=20, samples=2, params={"a": 1e-9})
    up, down = found["x"][:, :, -1]
    for branch, jump in ((up, fold), (down, -fold)):
        for value, x in zip(b, branch, strict=True):
            roots = np.roots([-1.0, 0.0, 1.0, value])
            real = sorted(root.real for root in roots if abs(root.imag) < 1e-9)
            expected = real[0] if value < jump else real[-1]
            assert x == pytest.approx(expected, abs=1e-6)
    assert (np.abs(up - down) > 1.0).sum() == (np.abs(b) < fold).sum()


def test_the_falling_branch_starts_at_the_end_of_the_rising_one() -> None:
    """A state that grows by 1 in each period counts the periods of all runs before its own."""
    counted = hs.Model(
        "counted", parameters={"r": 1.0}, states=[hs.State("x", 0, "1/(2*pi) + r*cos(t)", nominal=1.0)]
    )
    found = hs.bifurcation(counted, "r", [1.0, 2.0], settle=3, samples=2)
    last = found["x"][:, :, -1]
    assert last == pytest.approx(np.array([[5.0, 10.0], [20.0, 15.0]]), abs=1e-6)


def test_a_level_as_section_of_a_limit_cycle() -> None:
    found = hs.bifurcation(CIRCLE, "r", [0.25, 1.0, 4.0], section="y", settle=10, samples=3)
    assert not found.failed.any()
    assert found["x"] == pytest.approx(np.tile([[[0.5], [1.0], [2.0]]], (2, 1, 3)), rel=1e-8)
    assert found["y"] == pytest.approx(np.zeros((2, 3, 3)), abs=1e-8)
    assert (found["repeats_after"] == 1).all()


def test_friction_repeats_each_period_whatever_the_number_of_workers() -> None:
    loads = [25.0, 26.0, 30.0]
    found = hs.bifurcation("dfcs", "F0", loads, settle=30, samples=4, workers=1)
    again = hs.bifurcation("dfcs", "F0", loads[::-1], settle=30, samples=4, workers=2)
    assert found["x"].tobytes() == again["x"].tobytes() and (found["repeats_after"] == 1).all()
    assert found.units["x"] == "m" and found.units["F0"] == "N"
    (panel,) = found.plot("x", over="F0")
    assert panel.get_xlabel() == r"F$_{\mathregular{0}}$ [N]"


def test_after_how_many_samples_they_repeat() -> None:
    three, tols = np.tile([[1.0, 5.0], [2.0, 5.0], [4.0, 5.0]], (4, 1)), np.array([1e-6, 1e-6])
    assert repeats_after(three, tols) == 3
    assert repeats_after(three[:, 1:], tols[1:]) == 1
    assert repeats_after(three, np.array([4.0, 0.0])) == 1
    assert repeats_after(np.arange(10.0)[:, None], tols[:1]) == 0
    assert repeats_after(three[:5], tols) == 0


def test_a_section_that_is_never_passed_is_a_status() -> None:
    found = hs.bifurcation(WELLS, "b", [0.0], section="x - 50", settle=1, samples=1)
    (said,) = set(found.status.ravel())
    assert said.startswith("SimulationError: the section was not crossed upward in a run of")


@pytest.mark.parametrize(
    "given, message",
    [
        ({"parameter": "x"}, r"x is a state, but bifurcation\(\) varies a parameter"),
        ({"parameter": "q"}, "no parameter or state 'q'"),
        ({"samples": 0}, "`samples` cannot be 0"),
        ({"tol": 0}, "`tol` cannot be 0"),
        ({"section": 3}, "`section` cannot be 3"),
        ({"save": "nothing"}, "sets the option 'save' itself"),
        ({"rtoll": 1e-8}, "'rtoll' is not an option of simulate"),
        ({"integrator": "dop853", "step": 1.0}, "'step' is not an option of simulate or of dop853"),
    ],
)
def test_what_cannot_be_asked_for(given: dict[str, object], message: str) -> None:
    with pytest.raises(hs.UsageError, match=message):
        hs.bifurcation(OSCILLATOR, **({"parameter": "w", "values": [1.0]} | given))


def test_no_period_says_what_to_do() -> None:
    with pytest.raises(hs.UsageError, match="model circle has no single forcing period") as caught:
        hs.bifurcation(CIRCLE, "r", [0.5, 1.0])
    assert "set `section` to" in str(caught.value)


def test_no_period_at_one_value_is_the_status_of_that_value() -> None:
    """With a frequency of zero the forcing is a constant."""
    model = hs.Model(
        "driven", parameters={"w": 1.0}, states=[hs.State("x", 0.0, "sin(w*t) - x", nominal=1.0)]
    )
    found = hs.bifurcation(model, "w", [0.0, 1.0], settle=1, samples=1)
    assert found.status[0].tolist()[1] == "ok" and "no single forcing period" in found.status[0, 0]


def test_frequency_response() -> None:
    frequencies, loads = [350.0, 500.0, 650.0], [20.0, 40.0]
    found = hs.frequency_response("dfcs", frequencies, {"N": loads})
    assert found.dimensions == ("N", "omega")
    for i, load in enumerate(loads):
        for k, omega in enumerate(frequencies):
            steady = hs.steady_state("dfcs", params={"N": load, "omega": omega})
            assert found["amplitude.x"][i, k] == steady.amplitude["x"]
            assert found["stops_per_period.f"][i, k] == steady.stops_per_period["f"]
    warm = hs.frequency_response("dfcs", frequencies, {"N": loads}, warm_start=True)
    assert warm.dimensions == ("omega", "N")
    assert warm["amplitude.x"] == pytest.approx(found["amplitude.x"].T, rel=1e-9)
    assert len(found.plot(over="omega")) == 3
    with pytest.raises(hs.UsageError, match="other than the frequency"):
        hs.frequency_response("dfcs", frequencies, {"omega": loads})


@pytest.mark.parametrize(
    ("law", "arguments", "stiffness", "damping"),
    [
        ("tanh", {"mu": 1e5, "v0": 1e6}, 0.0, 0.1),
        ("dahl", {"mu": 1e9, "sigma": 2.0}, 2.0, 0.0),
        ("jenkins", {"mu": 1e3, "k": 2.0}, 2.0, 0.0),
    ],
)
def test_a_law_without_stick_has_a_frequency_response(
    law: str, arguments: dict[str, float], stiffness: float, damping: float
) -> None:
    """The law is a damper mu/v0 for low speeds, or a spring for a high limit: x = F/|k - w^2 + i c w|."""
    model = hs.Model(
        "linear-limit",
        [hs.State("x", 0, "v"), hs.State("v", 0, "cos(omega*t) - x - 0.3*v - f")],
        parameters={"omega": 1.3},
        contacts=[hs.Contact("f", "v", 1, law, arguments=arguments)],
    )
    found = hs.frequency_response(model, [0.7, 1.3])
    assert list(found.values) == ["amplitude.x"] and (found.status == "ok").all()
    exact = [1.0 / abs(1.0 + stiffness - w * w + 1j * (0.3 + damping) * w) for w in (0.7, 1.3)]
    assert found["amplitude.x"] == pytest.approx(exact, rel=1e-7)


def test_a_frequency_with_another_name_is_an_argument() -> None:
    model = hs.Model("forced", [hs.State("x", 0, "cos(w*t) - x")], parameters={"w": 1})
    with pytest.raises(
        hs.UsageError, match=r"no parameter 'omega'(.|\n)*pass `frequency`(.|\n)*known parameters: w"
    ):
        hs.frequency_response(model, [1, 2])
    found = hs.frequency_response(model, [1, 2], frequency="w")
    assert found["amplitude.x"] == pytest.approx([2**-0.5, 5**-0.5], rel=1e-6)  # 1/|1 + i w|
