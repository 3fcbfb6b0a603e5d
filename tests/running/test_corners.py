"""Runs across corners: as accurate as if there were none, and nothing to be seen of them unless asked."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.reference.multiple_precision import multiple_precision_trajectory

PERIOD = 1.5 * math.pi  # frequency 2 on the right of 0, 1 on the left


def bilinear(**start: float) -> hs.Model:
    states = [hs.State("x", 1, der="v"), hs.State("v", 0, der="-x - k*max(x, 0)")]
    return hs.Model("bilinear", states=states, parameters={"k": 3}).with_start(**start)


def rubbing() -> hs.Model:
    """A block on a belt of dry friction with a bilinear spring, drag and a load that a corner changes."""
    states = [
        hs.State("x", 0, der="v"),
        hs.State("v", 0, der="2*sin(0.7*t) - x - 3*max(x - 0.2, 0) - 0.1*abs(v)*v - f"),
    ]
    contact = hs.Contact("f", "v", "1 + 0.3*abs(x)", "coulomb", {"mu": 0.5})
    return hs.Model("rubbing", states=states, contacts=[contact], outputs={"gap": "max(x - 0.2, 0)"})


def test_corners_are_kept_apart() -> None:
    sol = hs.simulate(bilinear(), (0, PERIOD))
    assert sol.integrator == "exact"
    assert (sol.events, sol.modes) == ((), {})
    assert [(event.kind, event.component, event.target) for event in sol.corners] == [
        ("corner", "max(x, 0)", "-"),
        ("corner", "max(x, 0)", "+"),
    ]
    assert [event.t for event in sol.corners] == pytest.approx([math.pi / 4, math.pi * 5 / 4], abs=1e-13)
    assert list(sol.event_times("max(x, 0)")) == [event.t for event in sol.corners]
    assert not any("corner" in name for name in sol.table().columns)
    with pytest.raises(hs.UsageError, match="no component"):
        hs.simulate(bilinear(), (0, 1), z0={"max(x, 0)": "-"})


@pytest.mark.parametrize("save", ["events", "last-period", 1.0])
def test_what_is_kept_of_a_run_does_not_show_them_either(save: str | float) -> None:
    sol = hs.simulate(rubbing(), (0, 20), keep=save)
    whole = hs.simulate(rubbing(), (0, 20))
    assert list(sol.modes) == ["f"]
    assert [event.t for event in sol.events] == [event.t for event in whole.events if event.t >= sol.t_start]
    assert all(event.kind == "transition" for event in sol.events)


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "cvode-adams"])
def test_contacts_beside_corners(integrator: str) -> None:
    """Against a motion in 32 digits, whose events and series share no code with the engine's."""
    model = rubbing()
    truth = multiple_precision_trajectory(model, (0, 20))
    sol = hs.simulate(model, (0, 20), integrator=integrator, rtol=1e-10)
    assert len(sol.corners) > 5
    assert [event.target for event in sol.events] == [event.target for event in truth.events]
    assert [event.t for event in sol.events] == pytest.approx([event.t for event in truth.events], abs=1e-8)
    assert sol(20.0) == pytest.approx(truth.states(np.array([20.0]), "+").ravel(), abs=1e-8)
    assert sol.output("gap", 20.0) == max(sol(20.0)[0] - 0.2, 0.0)


def test_backward_through_corners() -> None:
    """They have one past, unlike a transition."""
    sol = hs.simulate(bilinear(), (2 * PERIOD, 0), integrator="taylor", rtol=1e-12)
    assert sol.status == "finished"
    assert len(sol.corners) == 4
    assert sol(0.0) == pytest.approx([1.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "scipy-dop853", "cvode-bdf"])
def test_an_argument_that_stays_at_zero(integrator: str) -> None:
    sol = hs.simulate(bilinear(x=0.0), (0, 10), integrator=integrator)
    assert (sol.status, sol.corners, sol.warnings) == ("finished", (), ())
    assert (sol.y == 0.0).all()
    if integrator.startswith("scipy"):
        native = hs.simulate(bilinear(x=0.0), (0, 10), integrator=integrator, events="native")
        assert (native.status, native.corners) == ("finished", ())


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_an_argument_that_dies_away(integrator: str) -> None:
    """x' = -|x| from 1, down to where doubles end: e**-900 is none."""
    model = hs.Model("fading", states=[hs.State("x", 1, der="-abs(x)")])
    sol = hs.simulate(model, (0, 900), integrator=integrator)
    assert sol.status == "finished"
    assert sol(10.0)[0] == pytest.approx(math.exp(-10), rel=1e-7)
    assert abs(sol(900.0)[0]) < 1e-11
    assert len(sol.corners) < 200


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_two_corners_at_one_instant(integrator: str) -> None:
    """Two equal oscillators, the second in the mirror."""
    states = [
        *bilinear().states,
        hs.State("y", -1, der="w"),
        hs.State("w", 0, der="-y - k*min(y, 0)"),
    ]
    sol = hs.simulate(
        hs.Model("twins", states=states, parameters={"k": 3}),
        (0, 4 * PERIOD),
        integrator=integrator,
        rtol=1e-11,
    )
    assert len(sol.corners) == 16
    assert sol.y[:, -1] == pytest.approx([1, 0, -1, 0], abs=1e-8)


@pytest.mark.parametrize("integrator", ["taylor", "dop853"])
def test_what_watches_a_corner_at_its_zero(integrator: str) -> None:
    """x = sin(t): |x| touches zero at pi, and neither guard nor monitor on it fires there; |x| - 1/2 crosses."""
    modes = (hs.Mode("a", (hs.Guard("g", "size", ("b",)),)), hs.Mode("b"))
    model = hs.Model(
        "watched",
        states=[hs.State("x", 0.1, der="cos(t + 0.1)*1")],
        components=[hs.Component("c", modes, initial="a")],
        definitions={"size": "abs(sin(t + 0.1))"},
        monitors=[hs.Monitor("half", "size - 0.5")],
    )
    sol = hs.simulate(model, (0, 4), integrator=integrator)
    assert sol.status == "finished"
    assert [(event.component, event.direction) for event in sol.events] == [
        ("half", 1),
        ("half", -1),
        ("half", 1),
    ]
    assert [event.t + 0.1 for event in sol.events] == pytest.approx(
        [math.pi / 6, math.pi * 5 / 6, math.pi * 7 / 6], abs=1e-9
    )


def test_a_load_that_is_cut_off_at_zero() -> None:
    """N = max(1 - x, 0) slides a block that is pushed: friction ends with the load, and the run goes on."""
    states = [hs.State("x", 0, der="v"), hs.State("v", 1, der="-f")]
    contact = hs.Contact("f", "v", "max(1 - x, 0)", "coulomb", {"mu": 0.5})
    model = hs.Model("light", states=states, contacts=[contact])
    sol = hs.simulate(model, (0, 4), integrator="taylor", rtol=1e-12)
    # v**2 = 1 - x + x**2/2 up to x = 1, where v**2 = 1/2
    assert sol.status == "finished"
    assert [event.component for event in sol.corners] == ["max(1 - x, 0)"]
    assert sol.corners[0].x_plus == pytest.approx([1.0, math.sqrt(0.5)], abs=1e-12)
    assert sol.y[1, -1] == pytest.approx(math.sqrt(0.5), abs=1e-12)


def test_the_model_stays_as_it_was_written() -> None:
    model = rubbing()
    sol = hs.simulate(model, (0, 1))
    assert sol.model is model
    assert hs.Model.from_toml(model.to_toml()) == model
    fun, events, _ = hs.to_ivp(model, {"f": "slip+"})
    assert {event.component for event in events} == {"f"}
    for x, v in ((1.0, 2.0), (-1.0, 2.0), (0.1, 0.5)):
        rate = -x - 3 * max(x - 0.2, 0) - 0.1 * abs(v) * v - 0.5 * (1 + 0.3 * abs(x))
        assert fun(0.0, [x, v]) == pytest.approx([v, rate], rel=1e-14)
    smooth = hs.simulate(model.regularized("tanh", v0=1e-2), (0, 1))
    assert smooth.success and list(smooth.modes) == ["f"]


def test_a_comparison_goes_across_them() -> None:
    result = hs.compare(
        rubbing(),
        t_span=(0, 10),
        integrators=["dop853", "taylor"],
        rtols=[1e-9],
        repeat=1,
        reference="multiple precision",
    )
    assert [row.integrator for row in result.rows] == ["dop853", "taylor"]
    assert all(row.status == "finished" and row.errors.state < 1e-7 for row in result.rows)


def test_models_that_come_and_go_are_not_mixed_up() -> None:
    """Each is let go of after its run, and the next may stand at its place in memory."""
    for k in range(40):
        start = 1.0 + k
        sol = hs.simulate(
            hs.Model("fading", states=[hs.State("x", start, der="-abs(x)")]), (0, 1), integrator="exact"
        )
        assert sol(0.0)[0] == start
        del sol
