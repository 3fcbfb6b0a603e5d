"""Derivatives of periodic motions and their readings by parameters, against closed forms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest
from known_slopes import EXACT, slope

import hybridsim as hs


def agrees(
    found: hs.SteadyState,
    reading: tuple[str, ...],
    form: Callable[..., mp.mpf],
    values: dict[str, float],
    error: float = EXACT,
) -> None:
    """Compare a reading and its derivatives with those of a closed form."""
    change = found.sensitivities(list(values))
    got = (
        (found.period, change.period_by_parameter)
        if reading == ("period",)
        else ((one := change.of(*reading)).value, one.by_parameter)
    )
    expected = [slope(form, values, name) for name in values]
    value = float(form(**{k: mp.mpf(v) for k, v in values.items()}))
    assert got[0] == pytest.approx(value, rel=error, abs=error * (abs(value) or 1.0))
    assert got[1] == pytest.approx(expected, rel=error, abs=error * (max(map(abs, expected)) or 1.0))


FORCED = {"F": 2.0, "w": 1.3, "c": 0.4, "k": 4.0, "b": 0.25}


def forced(**more: object) -> hs.Model:
    """A linear oscillator under a constant and a harmonic force."""
    return hs.Model(
        "forced",
        parameters=FORCED,
        states=[
            hs.State("x", 0, "v", nominal=1),
            hs.State("v", 0, "F*cos(w*t) + b - k*x - c*v", nominal=1),
        ],
        **more,
    )


@pytest.mark.parametrize(
    ("reading", "form"),
    [
        (("amplitude", "x"), lambda F, w, c, k, b: F / mp.hypot(k - w**2, c * w)),
        (("maximum", "x"), lambda F, w, c, k, b: b / k + F / mp.hypot(k - w**2, c * w)),
        (("minimum", "v"), lambda F, w, c, k, b: -w * F / mp.hypot(k - w**2, c * w)),
        (("mean", "x"), lambda F, w, c, k, b: b / k),
        (
            ("mean", "x", "x"),
            lambda F, w, c, k, b: (b / k) ** 2 + F**2 / (2 * ((k - w**2) ** 2 + (c * w) ** 2)),
        ),
        (
            ("integral", "v", "v"),
            lambda F, w, c, k, b: mp.pi / w * w**2 * F**2 / ((k - w**2) ** 2 + (c * w) ** 2),
        ),
        (("period",), lambda F, w, c, k, b: 2 * mp.pi / w),
    ],
)
def test_a_forced_oscillator(reading: tuple[str, ...], form: Callable[..., mp.mpf]) -> None:
    """x = b/k + A cos(w t - phase) with A = F/|k - w^2 + i c w|."""
    agrees(hs.steady_state(forced()), reading, form, FORCED)


BELT = {"k": 4.0, "V": 0.5, "mu_s": 1.2, "mu_k": 0.7}


def drop(k: mp.mpf, mu_s: mp.mpf, mu_k: mp.mpf) -> mp.mpf:
    """The distance by which the release is beyond the middle of the slip."""
    return (mu_s - mu_k) / k


@pytest.mark.parametrize(
    ("reading", "form"),
    [
        (
            ("period",),
            lambda k, V, mu_s, mu_k: (
                2 * (mp.pi - mp.atan(mp.sqrt(k) * drop(k, mu_s, mu_k) / V)) / mp.sqrt(k)
                + 2 * drop(k, mu_s, mu_k) / V
            ),
        ),
        (("amplitude", "x"), lambda k, V, mu_s, mu_k: mp.hypot(drop(k, mu_s, mu_k), V / mp.sqrt(k))),
        (("minimum", "f"), lambda k, V, mu_s, mu_k: -mu_s),
        (("maximum", "f"), lambda k, V, mu_s, mu_k: mu_s - 2 * mu_k),
        (("integral", "v"), lambda k, V, mu_s, mu_k: 0 * k),
    ],
)
def test_stick_and_slip_on_a_belt(reading: tuple[str, ...], form: Callable[..., mp.mpf]) -> None:
    """The block sticks from x = (2 mu_k - mu_s)/k to mu_s/k and swings back around mu_k/k."""
    model = hs.Model(
        "belt",
        parameters=BELT,
        states=[hs.State("x", 0, "v", nominal=1), hs.State("v", "V", "-k*x - f", nominal=1)],
        contacts=[hs.Contact("f", "v - V", 1, "static-kinetic", {"mu_s": "mu_s", "mu_k": "mu_k"})],
    )
    agrees(hs.steady_state(model), reading, form, BELT)


def test_the_motion_of_den_hartog() -> None:
    """Coulomb friction without stops: x_max = F/k sqrt(V^2 - (f/F)^2 U^2).

    V = 1/(1 - r^2), U = sin(pi/r)/(r (1 + cos(pi/r))), r = w/sqrt(k) (J. P. Den Hartog, Trans. ASME 53 (1931) 107).
    """
    values = {"F": 3.0, "w": 1.2, "k": 4.0, "mu": 0.5}
    model = hs.Model(
        "den-hartog",
        parameters=values,
        states=[hs.State("x", 0, "v", nominal=1), hs.State("v", 0, "F*cos(w*t) - k*x - f", nominal=1)],
        contacts=[hs.Contact("f", "v", 1, "coulomb", {"mu": "mu"})],
    )

    def top(F: mp.mpf, w: mp.mpf, k: mp.mpf, mu: mp.mpf) -> mp.mpf:
        r = w / mp.sqrt(k)
        V, U = 1 / (1 - r**2), mp.sin(mp.pi / r) / (r * (1 + mp.cos(mp.pi / r)))
        return F / k * mp.sqrt(V**2 - (mu / F * U) ** 2)

    steady = hs.steady_state(model)
    assert steady.stick_fraction["f"] == 0.0
    agrees(steady, ("maximum", "x"), top, values)
    agrees(steady, ("amplitude", "x"), top, values)


def test_stick_and_slip_under_a_forcing() -> None:
    """The release of a contact, at which its velocity is zero, is no graze; the reference is a central difference."""
    values = {"F0": 1e-3, "omega": 1e-3}
    found = hs.steady_state("dfcs").sensitivities(list(values)).of("amplitude", "x")
    start = hs.load("dfcs").parameter_values()
    for k, (name, step) in enumerate(values.items()):
        low, high = (
            hs.steady_state("dfcs", params={name: start[name] + side * step}).amplitude["x"]
            for side in (-1, 1)
        )
        assert found.by_parameter[k] == pytest.approx((high - low) / (2 * step), rel=1e-6)


WAVE = {"a": 1.2, "T": 2.0, "d": 0.3, "L": 2.5}


def least(a: mp.mpf, T: mp.mpf, d: mp.mpf, L: mp.mpf) -> mp.mpf:
    """The value at the end of the low part of a square wave, from which x rises for the time d T."""
    up, down = mp.exp(-a * d * T), mp.exp(-a * (1 - d) * T)
    top = L / a * (1 - up - up * (1 - down)) / (1 - up * down)
    return -L / a + (top + L / a) * down


@pytest.mark.parametrize("phase", [0.0, 0.5])
def test_a_kink_at_the_start_of_the_period(phase: float) -> None:
    """x' = u - a x under a square wave is least where u rises: at the start and the end of the period, or inside it."""
    wave = hs.Input("u", "wave", shape="square", amplitude="L", period="T", duty="d", phase=phase)
    model = hs.Model("wave", parameters=WAVE, states=[hs.State("x", 0, "u - a*x", nominal=1)], inputs=[wave])
    steady = hs.steady_state(model)
    agrees(steady, ("minimum", "x"), least, WAVE)
    agrees(steady, ("period",), lambda a, T, d, L: T, WAVE)


def test_a_rest() -> None:
    """A damped oscillator rests at b/k."""
    model = hs.Model(
        "rest",
        parameters={"b": 0.5, "k": 4.0},
        states=[hs.State("x", 0, "v", nominal=1), hs.State("v", 0, "b - k*x - v", nominal=1)],
    )
    agrees(hs.steady_state(model), ("mean", "x"), lambda b, k: b / k, {"b": 0.5, "k": 4.0})


def test_a_rest_of_a_family_is_refused() -> None:
    """A block on dry friction may rest at any place of an interval: its multiplier is 1."""
    with pytest.raises(hs.UsageError, match="multiplier 1, which is too close to 1"):
        hs.steady_state("free-decay").sensitivities(["mu"])


def test_periods_that_no_longer_fit_are_refused() -> None:
    """With w and 2 w the periods keep their ratio; with w and u they lose it."""
    parameters = {"w": 1.0, "u": 2.0}
    model = hs.Model(
        "two",
        parameters=parameters,
        states=[hs.State("x", 0, "sin(w*t) + cos(u*t) - x", nominal=1)],
    )
    steady = hs.steady_state(model)
    with pytest.raises(hs.UsageError, match="a change of u changes the forcing periods by different"):
        steady.sensitivities(["u"])
    tied = hs.steady_state(model.with_(u="2*w"))
    assert tied.sensitivities(["w"]).period_by_parameter == pytest.approx([-2 * np.pi], rel=EXACT)


def test_a_graze_is_refused() -> None:
    """A guard that is zero exactly at the peak of the motion."""
    peak = FORCED["b"] / FORCED["k"] + FORCED["F"] / float(
        np.hypot(FORCED["k"] - FORCED["w"] ** 2, FORCED["c"] * FORCED["w"])
    )
    modes = [
        hs.Mode("below", hs.Guard("hit", f"{peak!r} - x", hs.Choice("above"))),
        hs.Mode("above", hs.Guard("back", f"x - {peak!r}", hs.Choice("below"))),
    ]
    wall = hs.Component("wall", modes, initial="below")
    with pytest.raises(hs.UsageError, match=r"hit of wall .*touches zero without an event"):
        hs.steady_state(forced(components=[wall])).sensitivities(["F"])


def test_two_equal_extreme_values_are_refused() -> None:
    """(x - b/k)^2 is largest at both ends of the swing, and a change of the level in it makes one of them larger."""
    model = forced(outputs=[hs.Output("square", "(x - level)**2")])
    model = replace(model, parameters=(*model.parameters, hs.Parameter("level", FORCED["b"] / FORCED["k"])))
    with pytest.raises(
        hs.UsageError, match=r"same maximum(?s:.)*use an output that has its extreme value once"
    ):
        hs.steady_state(model).sensitivities(["level"]).of("maximum", "square")


def test_motions_and_names_without_derivatives_are_refused() -> None:
    """An unknown parameter, time in a reading, and a period that was given as a number."""
    steady = hs.steady_state(forced())
    with pytest.raises(hs.UsageError, match="no parameter 'f'"):
        steady.sensitivities(["f"])
    with pytest.raises(hs.UsageError, match="the time t cannot be measured"):
        steady.sensitivities(["F"]).of("mean", "t", "x")
    plain = hs.Model(
        "plain", parameters={"a": 1.0}, states=[hs.State("x", 0, "a - x + 1e-9*exp(-t)", nominal=1)]
    )
    with pytest.raises(hs.UsageError, match="period of the motion was given as a number"):
        hs.steady_state(plain, period=2.0).sensitivities(["a"])
