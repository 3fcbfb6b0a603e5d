"""Fast speeds under a law that has long fallen, and events inside long steps: what a default run must get right."""

from __future__ import annotations

import pytest

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
