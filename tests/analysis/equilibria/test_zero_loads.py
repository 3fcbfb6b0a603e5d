"""A linearization warns of a load that is zero at its time and changes later."""

from __future__ import annotations

from dataclasses import replace

import pytest

import hybridsim as hs

FALLING = hs.FrictionLaw("falling", slip="mu*N/(1 + v)", stick="mu*N", parameters=["mu"])


def pad(normal: str) -> hs.Model:
    """A block on a belt of speed 1: its growth in steady sliding is mu N/8, from the slope of friction there."""
    return hs.Model(
        "pad",
        parameters={"N0": 4, "tr": 2},
        states=[hs.State("x", 0, "v", nominal=1), hs.State("v", 0, "-x - f", nominal=1)],
        definitions={"ramp": "min(t/tr, 1)"},
        inputs=[
            hs.Input("table", "table", times=[0, 2], values=[0, 1]),
            hs.Input("wave", "wave", shape="sine", period=4),
        ],
        contacts=[hs.Contact("f", velocity="v - 1", normal=normal, law=FALLING, arguments={"mu": 0.1})],
    )


@pytest.mark.parametrize(
    "normal",
    [
        "N0*min(t/tr, 1)",
        "N0*t/tr if t < tr else N0",
        "N0*ramp",
        "N0*table",
        "N0*abs(wave)",
        "N0*max(0, t - 1)",
    ],
)
def test_a_load_that_is_still_zero_is_named(normal: str) -> None:
    found = hs.linearize(pad(normal), "slip-")
    (warning,) = found.warnings
    assert warning.startswith("the normal load of f is 0 at t = 0.") and "final load as a constant" in warning
    assert f"warning: {warning}" in str(found)


@pytest.mark.parametrize(
    ("normal", "t", "largest"),
    [
        ("N0*abs(sin(pi*t))", 1.0, 4.0),  # the sine of pi is 1.2e-16, not 0
        ("N0*abs(wave)", 2.0, 4.0),
        ("N0*abs(wave)", 2.0004, 4.0),
        ("N0*(1.0001 - cos(pi*t/2))", 0.0, 8.0004),
        ("N0*(table + 1e-4)", 0.0, 4.0004),
    ],
)
def test_a_load_that_is_small_beside_its_largest_is_named(normal: str, t: float, largest: float) -> None:
    model = pad(normal)
    used = [signal for signal in model.inputs if signal.name in normal]
    (warning,) = hs.linearize(replace(model, inputs=used), "slip-", t=t).warnings
    assert f"at t = {t:g}, below 0.001 of its largest value {largest:.4g}." in warning


@pytest.mark.parametrize("normal", ["N0*(t - 0.3)", "N0*t - 1.2", "N0*load"])
def test_a_load_that_is_zero_only_by_rounding_is_named(normal: str) -> None:
    """0.1 + 0.2 is larger than 0.3 by 5.6e-17, and nothing tells how large the load becomes later."""
    model = replace(_only(normal), definitions={"load": "t - 0.3"})
    (warning,) = hs.linearize(model, "slip-", t=0.1 + 0.2).warnings
    assert "e-16 at t = 0.3, zero within rounding. The model" in warning
    assert hs.linearize(model, "slip-", t=0.3 + 1e-9).warnings == ()


@pytest.mark.parametrize(
    ("normal", "load", "final"),
    [
        ("N0*table", 2.0, 4.0),
        ("N0*ramp", 2.0, 4.0),
        ("N0*(1.5 - table)", 4.0, 2.0),
        ("N0*(1 - exp(-t))", 2.528, 4.0),
    ],
)
def test_a_load_that_settles_at_another_value_is_named(normal: str, load: float, final: float) -> None:
    model = replace(pad(normal), inputs=pad(normal).inputs[:1])
    (warning,) = hs.linearize(model, "slip-", t=1.0).warnings
    assert f"is {load:.4g} at t = 1 and settles at {final:.4g}." in warning
    later = 100.0 if "exp" in normal else 2.0
    assert hs.linearize(model, "slip-", t=later).warnings == ()


@pytest.mark.parametrize("normal", ["N0*(1 + t)", "N0*(1.5 + wave)", "N0*(1.5 + sin(t))"])
def test_a_load_that_never_settles_is_not_named(normal: str) -> None:
    assert hs.linearize(pad(normal), "slip-", t=1.0).warnings == ()


def test_a_load_on_a_sine_wave_that_is_large_is_not_named() -> None:
    """At a quarter of its period the wave is at its largest value, 1."""
    assert hs.linearize(pad("N0*abs(wave)"), "slip-", t=1.0).warnings == ()


def test_a_hundredth_of_the_largest_load_is_not_small() -> None:
    waving = replace(pad("N0*(1.02 - cos(pi*t/2))"), inputs=())  # from 0.02 to 2.02 N0
    found = hs.linearize(waving, "slip-")
    assert found.warnings == () and found.growth == pytest.approx(0.02 * 0.05, rel=1e-9)


@pytest.mark.parametrize(("start", "is_named"), [(0.0, True), (2.0, False)])
def test_a_load_that_a_schedule_applies_is_named(start: float, is_named: bool) -> None:
    applied = hs.Schedule("applied", times=[1], reset={"load": 1})
    model = replace(_only("N0*load"), discrete=[hs.Discrete("load", start)], schedules=[applied])
    assert bool(hs.linearize(model, "slip-").warnings) == is_named


def test_other_loads_are_not_named() -> None:
    constant = hs.linearize(pad("N0"), "slip-")
    assert constant.warnings == () and "warning" not in str(constant)
    assert constant.growth == pytest.approx(0.05, rel=1e-12)
    assert hs.linearize(pad("N0*(1 + t)"), "slip-").warnings == ()
    later = hs.linearize(pad("N0*min(t/tr, 1)"), "slip-", t=3.0)
    assert later.warnings == () and later.growth == pytest.approx(0.05, rel=1e-12)


def test_the_remedies_name_the_final_value() -> None:
    with pytest.raises(hs.UsageError, match="or replace the step by its final value"):
        hs.steady_state(_only("N0*min(t/tr, 1)"))
    with pytest.raises(hs.UsageError, match="final value of the forcing as a constant"):
        hs.equilibria(_only("N0*min(t/tr, 1)"))


def _only(normal: str) -> hs.Model:
    return replace(pad(normal), inputs=())
