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
    assert warning.startswith("the normal load of f is 0 at t = 0,") and "final load as a constant" in warning
    assert f"warning: {warning}" in str(found)


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
