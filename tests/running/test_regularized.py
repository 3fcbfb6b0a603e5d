"""Regularised friction: the declared force, the way it tends to the contact as v0 falls, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from reference.dfcs_closed_form import Oscillator

import hybridsim as hs

DFCS = hs.load("dfcs")
PERIOD = 2 * math.pi / DFCS.parameter_values()["omega"]
KINDS = ("tanh", "arctan", "karnopp")


def error(kind: str, v0: float, periods: int = 4) -> float:
    """Largest error of the displacement over a few periods from rest, relative to its largest value."""
    p = DFCS.parameter_values()
    limit = p["mu"] * p["N"]
    exact = Oscillator(p["m"], p["c"], p["k"], limit, limit, p["F0"], p["omega"]).run(0, periods * PERIOD, 0)
    integrator = "dop853" if kind == "karnopp" else "scipy-radau"
    sol = hs.simulate(DFCS.regularized(kind, v0=v0), (0, periods * PERIOD), integrator=integrator, rtol=1e-7)
    times = np.linspace(0, periods * PERIOD, 2001)
    x = np.array([exact.state(t)[0] for t in times])
    return float(np.max(np.abs(sol(times)[0] - x)) / np.max(np.abs(x)))


@pytest.mark.parametrize(
    ("kind", "order"), [("tanh", (0.85, 1.05)), ("arctan", (0.55, 0.75)), ("karnopp", (0.95, 9.0))]
)
def test_the_order_in_v0(kind: str, order: tuple[float, float]) -> None:
    """First order but for logarithms with tanh; 2/3 with arctan, whose tails blunt each release.

    A release at which nothing jumps has m v' = L s, s after it. The force of arctan is short by F (2/pi) v0/v of
    its limit, so the motion is another as long as s**2 is below v0/s: for a time v0**(1/3), up to a speed
    v0**(2/3), and that remains.
    """
    loose, tight = error(kind, 1e-3), error(kind, 1e-4)
    assert tight < 0.02
    assert order[0] < math.log10(loose / tight) < order[1]


@pytest.mark.parametrize("v", [-0.3, -1e-4, 0.0, 2e-4, 0.1])
@pytest.mark.parametrize(
    ("kind", "force"),
    [("tanh", lambda u: math.tanh(u)), ("arctan", lambda u: 2 / math.pi * math.atan(u))],
)
def test_smooth_forces(kind: str, force, v: float) -> None:
    """The declared shape times the slip force at the speed, which falls with speed here."""
    model = hs.load("dfcs-stribeck").regularized(kind, v0=1e-3).with_start(v=v)
    p = model.parameter_values()
    slip = p["N"] * (p["mu_k"] + (p["mu_s"] - p["mu_k"]) * math.exp(-((v / p["v_s"]) ** 2)))
    sol = hs.simulate(model, (0, 1e-9))
    assert sol.output("f", 0.0) == pytest.approx(slip * force(v / 1e-3), rel=1e-14, abs=1e-300)
    assert [interval.mode for interval in sol.modes["f"]] == ["smooth"]


def test_karnopp_holds_a_loaded_body_and_lets_it_go_at_the_limit() -> None:
    """A block on a slope of slowly rising load: still up to mu_s*N, then off; with tanh it creeps all along."""
    model = hs.Model(
        "pulled",
        states=[hs.State("x", 0, der="v"), hs.State("v", 0, der="(2*t - f)/m")],
        parameters={"m": 2, "N": 10},
        contacts=[
            hs.Contact(
                "f", velocity="v", normal="N", law="static-kinetic", arguments={"mu_s": 0.4, "mu_k": 0.3}
            )
        ],
    )
    sol = hs.simulate(model.regularized("karnopp", v0=1e-3), (0, 3))
    assert sol(1.999).tolist() == [0.0, 0.0]
    assert sol.output("f", 1.5) == pytest.approx(3.0, rel=1e-14)
    assert sol.events[0].t == pytest.approx(2.0, rel=1e-12)  # 2 t = mu_s N
    # broken loose it has m v' = 2 (t - 2): the band is left at v0 = (t - 2)^2/m
    assert sol.events[1].t == pytest.approx(2 + math.sqrt(2e-3), rel=1e-9)
    assert [event.target for event in sol.events] == ["break+", "slip+"]


def test_karnopp_stops_a_sliding_body_in_its_band() -> None:
    model = hs.load("free-decay").regularized("karnopp", v0=1e-4).with_start(x=0.5, v=-0.3)
    sol = hs.simulate(model, (0, 10))
    stopped = sol.modes["f"][-1]
    assert stopped.mode == "stick"
    assert sol(stopped.t0)[1] == 0.0
    assert (sol(np.linspace(stopped.t0, 10, 50))[0] == sol(10.0)[0]).all()


def test_a_name_that_is_taken_and_a_round_trip() -> None:
    model = hs.Model(
        "taken",
        states=[hs.State("x", 0, der="v0"), hs.State("v0", 0, der="-x - f")],
        contacts=[hs.Contact("f", velocity="v0", normal=1, law="coulomb", arguments={"mu": 0.3})],
    )
    regular = model.regularized("tanh", v0=0.01)
    assert regular.parameter_values() == {"v0_": 0.01}
    for kind in KINDS:
        made = DFCS.regularized(kind, v0="1e-3*F0")
        assert hs.Model.from_toml(made.to_toml()) == made
        assert made.parameter_values()["v0"] == pytest.approx(0.03)


@pytest.mark.parametrize(
    ("model", "kind", "v0", "words"),
    [
        ("dfcs", "tan", 1e-3, "Unknown regularisation 'tan'"),
        ("dfcs", "tanh", 0.0, "`v0` cannot be 0.0"),
        ("thermostat", "tanh", 1e-3, "no contact"),
        ("static-kinetic", "tanh", 1e-3, "static friction"),
        ("sampled-servo", "arctan", 1e-3, "static friction"),
    ],
)
def test_refusals(model: str, kind: str, v0: float, words: str) -> None:
    with pytest.raises(hs.UsageError, match=words):
        hs.load(model).regularized(kind, v0=v0)


def test_karnopp_refuses_contacts_that_act_on_each_other() -> None:
    model = hs.Model(
        "two",
        states=[hs.State("v1", 1, der="-f1 + f2"), hs.State("v2", 0, der="-f2")],
        contacts=[
            hs.Contact("f1", velocity="v1", normal=1, law="coulomb", arguments={"mu": 0.3}),
            hs.Contact("f2", velocity="v2 - v1", normal=1, law="coulomb", arguments={"mu": 0.3}),
        ],
    )
    with pytest.raises(hs.UsageError, match="also acts on the velocity of this contact"):
        model.regularized("karnopp", v0=1e-3)
    hs.simulate(model.regularized("tanh", v0=1e-2), (0, 0.1))
