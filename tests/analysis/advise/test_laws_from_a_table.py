"""Rungs of the ladder for a friction law from a table: its values at rest and at the mean speed are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.analysis.ladder.equivalent_viscous import FirstHarmonic

AT, MU, MU_S, START, END = (0.0, 0.5, 2.0), (0.5, 0.4, 0.3), 0.55, 1.5, 0.2


def block(*tables: hs.LawTable, slip: str = "mu*N", **forces: str) -> hs.Model:
    """A block of unit mass and unit weight that slides from the speed START."""
    law = hs.FrictionLaw("measured", slip=slip, stick=f"{MU_S}*N", tables=list(tables), **forces)
    states = [hs.State("x", 0, "v"), hs.State("v", START, "-f")]
    return hs.Model("block", states, contacts=[hs.Contact("f", velocity="v", normal=1, law=law)])


def of_speed() -> hs.LawTable:
    return hs.LawTable("mu", AT, MU, interpolation="linear")


def rungs(model: hs.Model, quantity: str, t_span: tuple[float, float], *names: str) -> hs.Advice:
    return hs.advise(model, quantity, 0.01, t_span=t_span, integrators=False, rungs=names)


def test_constant_coefficients_come_from_the_table() -> None:
    model = block(of_speed())
    run = hs.simulate(model, (0, END))
    mean = float(run.output("x", END)) / END
    found = rungs(model, "final.v", (0, END), "constant-mu-at-rest", "constant-mu-mean")
    assert found["constant-mu-at-rest"].value == pytest.approx(START - MU[0] * END, rel=1e-8)
    assert found["constant-mu-mean"].value == pytest.approx(START - np.interp(mean, AT, MU) * END, rel=1e-6)


def test_one_coefficient_is_the_table_at_rest() -> None:
    """A block at rest is pulled by the force t: it breaks loose at the limit of stick."""
    held = block(of_speed())
    states = [held.states[0], hs.State("v", 0, "t - f")]
    pulled = hs.Model("pulled", states, contacts=held.contacts)
    assert hs.simulate(pulled, (0, 1)).event_times("f")[0] == pytest.approx(MU_S, rel=1e-9)
    found = rungs(pulled, "event_time.f.1", (0, 1), "mu_s=mu_k")
    assert found["mu_s=mu_k"].value == pytest.approx(MU[0], rel=1e-9)


def test_the_first_harmonic_of_a_table() -> None:
    """Of mu = 0.5 - 0.1 v: (4/pi) (0.5 - 0.1 V pi/4)."""
    model = block(hs.LawTable("mu", (0.0, 3.0), (0.5, 0.2), interpolation="linear"))
    (contact,) = model.contacts
    expected = 4 / math.pi * (0.5 - 0.1 * 2.0 * math.pi / 4)
    assert FirstHarmonic(model, contact)(2.0) == pytest.approx(expected, rel=1e-12)


def test_a_table_of_something_else_stays() -> None:
    """mu(x) = 0.5 - 0.1 x does not depend on the speed; the slip force 0.2 v does."""
    of_place = hs.LawTable("mu", (0.0, 2.0), (0.5, 0.3), over="p", interpolation="linear")
    law = hs.FrictionLaw(
        "place", slip="(mu + 0.2*v)*N", stick="mu*N", tables=[of_place], parameters={"p": None}
    )
    contact = hs.Contact("f", velocity="v", normal=1, law=law, arguments={"p": "x"})
    states = [hs.State("x", 0, "v"), hs.State("v", START, "-f")]
    found = rungs(hs.Model("place", states, contacts=[contact]), "final.v", (0, END), "constant-mu-at-rest")
    rate = math.sqrt(0.1)  # v' = -0.5 + 0.1 x
    expected = START * math.cosh(rate * END) - 0.5 / rate * math.sinh(rate * END)
    assert found["constant-mu-at-rest"].value == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize(
    ("model", "reason"),
    [
        (
            block(hs.LawTable("mu", AT, MU, over="v/2")),
            "the table mu of contact f depends on v/2, not on the speed v alone; ",
        ),
        (
            block(slip="(0.3 + 0.1*v)*N", slip_backward="0.2*N", stick_backward="0.2*N"),
            "the friction of contact f differs between the two sliding directions",
        ),
    ],
)
def test_a_rung_that_does_not_apply_says_which_of_two_reasons(model: hs.Model, reason: str) -> None:
    found = rungs(model, "final.v", (0, END), "constant-mu-at-rest", "constant-mu-mean")
    for step in (found["constant-mu-at-rest"], found["constant-mu-mean"]):
        assert step.verdict == "does not apply" and step.why.startswith(reason)
