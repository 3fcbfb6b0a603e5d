"""Fast speeds under a law that has long fallen, and events inside long steps: what a default run must get right."""

from __future__ import annotations

import math

import pytest
from scipy.integrate import quad

import hybridsim as hs


def pulled(rate: str) -> hs.Model:
    law = {"mu_s": 0.5, "mu_k": 0.3, "v_s": 0.1}
    contact = hs.Contact("f", velocity="v", normal=1, law="stribeck", arguments=law)
    return hs.Model("pulled", states=[hs.State("v", 0, rate)], contacts=[contact])


@pytest.mark.parametrize("integrator", ["dop853", "taylor", "cvode-bdf", "scipy-dop853"])
def test_a_law_far_beyond_its_speed(integrator: str) -> None:
    """exp(-(v/v_s)**2) is nothing at v = 27 v_s, and has series: the force is mu_k N there."""
    sol = hs.simulate(pulled("2 - f"), (0, 3), integrator=integrator)
    assert sol.success, sol.message
    assert sol(3.0)[0] - sol(2.0)[0] == pytest.approx(1.7, rel=1e-7)


@pytest.mark.parametrize("integrator", ["dop853", "taylor"])
def test_a_step_repeated_up_to_an_event_keeps_its_error(integrator: str) -> None:
    """The stop comes after a steep rise of friction at the end of a long smooth stretch; against SciPy's Radau."""
    model = pulled("5*sin(t) - f")
    exact = hs.simulate(model, (0, 6), integrator="scipy-radau", rtol=1e-10, max_step=0.01)
    found = hs.simulate(model, (0, 6), integrator=integrator, rtol=1e-9)
    assert found.events[-1].t == pytest.approx(exact.events[-1].t, abs=1e-7)


LOCATED = [
    "dop853", "tsit5", "rodas5p", "taylor", "scipy-rk23", "scipy-rk45", "scipy-dop853", "scipy-radau"
]  # fmt: skip


@pytest.mark.parametrize("watched", [False, True])
@pytest.mark.parametrize("v_s", [0.1, 0.01, 1e-3])
@pytest.mark.parametrize("integrator", LOCATED)
def test_a_law_that_is_steep_only_where_the_body_stops(integrator: str, v_s: float, watched: bool) -> None:
    """Friction rises within v_s of rest, in the last share v_s of a stretch along which the speed falls evenly.

    A step across it meets the friction at no stage and in no term of a series: (1 - v) = mu_k t before it and, by the
    law's continuation, after it. The time to rest is the integral of dv/f(v).
    """
    low, more = 0.3, 0.3
    stop, _ = quad(
        lambda v: 1.0 / (low + more * math.exp(-((v / v_s) ** 2))),
        0.0,
        1.0,
        points=[k * v_s for k in (0.5, 1, 2, 4, 6)],
        epsabs=1e-13,
    )
    law = {"mu_s": low + more, "mu_k": low, "v_s": v_s}
    contact = hs.Contact("f", velocity="v", normal=1, law="stribeck", arguments=law)
    model = hs.Model(
        "braked",
        states=[hs.State("x", 0, "v"), hs.State("v", 1, "-f")],
        contacts=[contact],
        monitors=[hs.Monitor("half", "x - 0.5")] if watched else [],
    )
    sol = hs.simulate(model, (0, 5), integrator=integrator, rtol=1e-8)
    assert [(e.component, e.target) for e in sol.events][-1] == ("f", "stick")
    assert sol.events[-1].t == pytest.approx(stop, abs=3e-7)
    assert len(sol.events) == (2 if watched else 1)


def on_belt(velocity: str, start: float, rate: str) -> hs.Model:
    """A mass on a spring, on a belt of speed 2, under friction that falls within 1 mm/s."""
    law = {"mu_s": 0.4, "mu_k": 0.25, "v_s": 1e-3}
    return hs.Model(
        "on-belt",
        states=[hs.State("x", 0, rate, nominal=1), hs.State("v", start, "-x - f", nominal=1)],
        contacts=[hs.Contact("f", velocity, "10", "stribeck-exponential", law)],
    )


@pytest.mark.parametrize("integrator", ["auto", *LOCATED])
def test_a_steep_law_of_a_velocity_with_a_number_in_it(integrator: str) -> None:
    """exp(-(v - 2)/v_s) is no product with exp(2000): the same motion as where v is measured from the belt."""
    runs = [
        hs.simulate(model, (0, 20), integrator=integrator, rtol=1e-8)
        for model in (on_belt("v - 2.0", 0.0, "v"), on_belt("v", -2.0, "v + 2"))
    ]
    assert [sol.status for sol in runs] == ["finished", "finished"]
    fixed, moving = ([(e.source, e.target) for e in sol.events] for sol in runs)
    assert fixed == moving
    # the law falls by 1.5 N within 1 mm/s of each release, which multiplies errors of rtol by thousands
    assert runs[0].event_times("f") == pytest.approx(runs[1].event_times("f"), abs=1e-4)


@pytest.mark.parametrize(("belt", "takes"), [(0.3, "dop853"), (-0.3, "dop853")])
def test_auto_looks_at_the_side_on_which_the_motion_is(belt: float, takes: str) -> None:
    """The law is steep as exp(30) on the side of slip where the body is not."""
    law = hs.FrictionLaw("falls", slip="N*(0.3 - 0.1*exp(-v/0.01))", stick="0.2*N")
    model = hs.Model(
        "on-belt",
        parameters={"belt": belt},
        states=[hs.State("x", 0, "v", nominal=1), hs.State("v", 0, "-x - f", nominal=1)],
        contacts=[hs.Contact("f", "v - belt", "10", law)],
    )
    assert hs.simulate(model, (0, 20)).integrator == takes
