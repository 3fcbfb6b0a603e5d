"""Fractional powers of a velocity: refused by name where stick is decided by derivatives, explained where they end."""

from __future__ import annotations

from dataclasses import replace
from math import log, sqrt

import pytest

import hybridsim as hs
from hybridsim.model.checks.doubtful import warnings_of

LOCATING = ("auto", "exact", "taylor", "dop853", "tsit5", "rodas5p", "scipy-rk45", "scipy-lsoda", "cvode-bdf")


def braked(power: str, rate: str = "-f", start: float = 1.0) -> hs.Model:
    """A body that friction with a limit of 0.5 brings to rest."""
    return hs.Model.from_toml(
        f"""
name = "braked"
[laws.own]
parameters = {{ c = 0.3, b = 1e-5, p = 1.5 }}
slip = "N*0.5 + 0*(b + c + p) + {power}"
stick = "N*0.5"
[states]
v = {{ start = {start}, der = "{rate}" }}
[contacts.f]
velocity = "v"
normal = 1
law = {{ name = "own" }}
""",
        path="braked.toml",
    )


def stop(c: float, v0: float) -> float:
    """When dv/dt = -1/2 - c sqrt(v) is at rest: with w = sqrt(v), 2 w dw/dt = -1/2 - c w."""
    w = sqrt(v0)
    return 2.0 / c * (w - log(1.0 + 2.0 * c * w) / (2.0 * c))


@pytest.mark.parametrize("integrator", LOCATING)
def test_a_law_is_refused_where_stick_is_decided_by_derivatives(integrator: str) -> None:
    with pytest.raises(hs.UsageError) as caught:
        hs.simulate(braked("c*v**1.5"), (0.0, 3.0), integrator=integrator)
    text = str(caught.value)
    assert text.startswith("braked.toml:5: ") and "cannot run model 'braked': 'v**1.5'" in text
    assert (
        "zero velocity of contact f" in text and "(v**2 + b**2)**0.75 - b**1.5" in text and "moreau" in text
    )


@pytest.mark.parametrize(
    ("written", "remedy"),
    [
        ("sqrt(abs(v))", "replace the power by (v**2 + b**2)**0.25 - b**0.5 with a small speed b"),
        ("v**p", "replace the power by (v**2 + b**2)**0.75 - b**1.5 with a small speed b"),
    ],
)
def test_a_law_is_named_once_by_its_own_line_and_text(written: str, remedy: str) -> None:
    """Both directions of slip contain the power, with the velocity of the contact inserted."""
    model = braked(f"c*{written}")
    contact = replace(model.contacts[0], velocity="v - 0.25*c", arguments={"c": 2})
    changed = replace(model, contacts=[contact], parameters={"c": 0.5})
    (caution,) = warnings_of(changed)
    assert caution.message.startswith(f"'{written}' in slip of the law own has no Taylor series")
    assert str(caution).startswith("braked.toml:5: ") and remedy in caution.remedy


@pytest.mark.parametrize(
    "power", ["c*sqrt(v)", "c*abs(v)**0.3", "c*(v/2)**p", "c*(v**2)**0.75", "c*sqrt(max(v, 0))", "c*v**2.5"]
)
def test_in_any_form(power: str) -> None:
    with pytest.raises(hs.UsageError, match="has no Taylor series at zero velocity of contact f"):
        hs.simulate(braked(power), (0.0, 3.0))


@pytest.mark.parametrize(
    "power", ["c*v**2", "c*(v**2 + b**2)**p", "c*((1 + v)**1.5 - 1)", "c*sqrt(v**2 + b**2) - c*b"]
)
def test_what_has_a_series_is_taken(power: str) -> None:
    assert hs.simulate(braked(power, start=0.0), (0.0, 0.1), integrator="scipy-rk45").success


def pushed(drag: str) -> hs.Model:
    contacts = [hs.Contact("f", "v", "1", "coulomb", {"mu": 0.5})]
    return hs.Model(
        "pushed", [hs.State("v", 0, f"sin(t) - c*{drag} - f")], {"c": 0.1, "p": 2}, contacts=contacts
    )


@pytest.mark.parametrize("base", ["v", "abs(v)"])
def test_a_large_whole_exponent_under_a_name_is_to_be_written_out(base: str) -> None:
    with pytest.raises(hs.UsageError, match="write the exponent as the number 6"):
        hs.simulate(pushed(f"{base}**p").with_(p=6), (0.0, 2.0), integrator="scipy-rk45")
    assert hs.simulate(pushed(f"{base}**6"), (0.0, 2.0), integrator="scipy-rk45").success
    assert hs.simulate(pushed(f"{base}**p"), (0.0, 2.0), integrator="scipy-rk45").success  # p = 2


def test_a_default_of_a_law_is_a_number() -> None:
    model = braked("c*v**p")
    with pytest.raises(hs.UsageError, match=r"'v\*\*p' in slip of the law own.*\n.*b\*\*1.5"):
        hs.simulate(model, (0.0, 0.1), integrator="scipy-rk45")


def test_time_stepping_takes_them_as_they_are() -> None:
    sol = hs.simulate(braked("c*sqrt(v)"), (0.0, 3.0), integrator="moreau", step=1e-4)
    assert sol.success and sol.y[0, -1] == 0.0
    assert sol.events[0].target == "stick" and sol.events[0].t == pytest.approx(stop(0.3, 1.0), abs=3e-4)


@pytest.mark.parametrize("integrator", ["scipy-dop853", "scipy-radau"])
def test_what_the_message_proposes_runs(integrator: str) -> None:
    sol = hs.simulate(braked("c*((v**2 + b**2)**0.25 - b**0.5)"), (0.0, 3.0), integrator=integrator)
    assert sol.success and sol.y[0, -1] == 0.0
    # the force is less by c sqrt(b) at most, which is 1e-3 of 0.5
    assert sol.events[0].t == pytest.approx(stop(0.3, 1.0), rel=2e-3)


def test_a_signed_velocity_is_refused_at_its_declaration() -> None:
    with pytest.raises(hs.ModelError) as caught:
        braked("c*v", rate="sin(t) - 0.1*v**1.5 - f")
    text = str(caught.value)
    assert text.startswith("braked.toml:8: 'v**1.5' in the rate of v is undefined for negative velocity")
    assert "v*(v**2 + b**2)**0.25" in text


def test_one_behind_a_condition_is_not() -> None:
    model = braked("c*v", rate="sin(t) - (v**1.5 if v > 0 else 0) - f")
    with pytest.raises(hs.UsageError, match="has no Taylor series"):
        hs.simulate(model, (0.0, 1.0))


@pytest.mark.parametrize(
    "integrator", ["taylor", "dop853", "scipy-rk45", "scipy-lsoda", "cvode-bdf", "moreau"]
)
def test_without_a_contact_the_run_ends_with_what_to_write(integrator: str) -> None:
    model = hs.Model("swing", [hs.State("x", 1, "v"), hs.State("v", 1, "-x - 0.3*v**1.5")])
    options = {"step": 1e-3} if integrator == "moreau" else {}
    sol = hs.simulate(model, (0.0, 10.0), integrator=integrator, limits={"steps": 100_000}, **options)
    assert sol.status == "step-failure" and abs(sol.y[1, -1]) < 1e-3
    assert "'v**1.5' has no value for v < 0" in sol.message and "abs(v)**1.5*sign(v)" in sol.message


def test_time_stepping_hides_no_missing_number_behind_stick() -> None:
    model = hs.Model(
        "pushed",
        [hs.State("x", 1, "v"), hs.State("v", 0, "-x - 0.3*log(v) - f")],
        contacts=[hs.Contact("f", "v", "1", "coulomb", {"mu": 0.2})],
    )
    assert hs.simulate(model, (0.0, 1.0), integrator="moreau", step=1e-3).status == "step-failure"
