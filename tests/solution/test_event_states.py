"""States at events in one array: those of the events as objects, in the same order."""

from __future__ import annotations

import numpy as np
import pytest

import hybridsim as hs

CASES = [
    ("dfcs", 0.4, {}),
    ("dfcs", 0.4, {"integrator": "taylor"}),  # whose record has other rows than that of exact
    ("dfcs", 0.3, {"integrator": "exact"}),
    ("bouncing-ball", 3.0, {}),
    ("clutches", 5.0, {}),
    ("dfcs", 0.2, {"integrator": "rk4-dichotomy", "step": 1e-4}),
    ("dfcs", 0.2, {"integrator": "scipy-dop853"}),
]


@pytest.mark.parametrize("name, end, options", CASES)
@pytest.mark.parametrize("save", ["all", "events"])
def test_they_are_those_of_the_objects(name: str, end: float, options: dict[str, object], save: str) -> None:
    model = hs.load(name)
    sol = hs.simulate(model, (0.0, end), keep=save, **options)
    again = hs.simulate(model, (0.0, end), keep=save, **options)
    assert sol.events
    for component in {e.component for e in sol.events}:
        mine = [e for e in sol.events if e.component == component]
        assert again.event_times(component).tolist() == [e.t for e in mine]
        for side, states in (("+", [e.x_plus for e in mine]), ("-", [e.x_minus for e in mine])):
            found = again.event_states(component, side=side)
            assert found.shape == (len(mine), len(sol.names))
            np.testing.assert_array_equal(found, states)
        kinds = {e.kind for e in mine}
        assert sum(len(again.event_states(component, kind)) for kind in kinds) == len(mine)
    component = sol.events[0].component
    again.event_states(component)[:] = -1.0  # an array of its own
    np.testing.assert_array_equal(again.event_states(component), sol.event_states(component))


def test_what_is_not_there() -> None:
    sol = hs.simulate("dfcs", (0.0, 1e-4))
    assert sol.event_states("f", "monitor").shape == (0, 2)
    with pytest.raises(hs.UsageError, match="`side` cannot be 'x'"):
        sol.event_states("f", side="x")
    with pytest.raises(hs.UsageError, match="no component"):
        sol.event_states("g")


@pytest.mark.parametrize("integrator", ["rk4-dichotomy", "rk4-sign", "exact", "dop853"])
def test_they_are_those_of_the_dense_output(integrator: str) -> None:
    """Steps went on in the array that an event held: its states were those of the end of the stretch behind it."""
    oscillator = hs.Model(
        "oscillator",
        states=[hs.State("x", 0, "v"), hs.State("v", 1, "-x-f")],
        contacts=[hs.Contact("f", velocity="v", normal=1, law="coulomb", arguments={"mu": 0.05})],
        monitors=[hs.Monitor("m", "x - 0.1")],
    )
    ball = hs.Model(
        "ball",
        states=[hs.State("h", 1, "w"), hs.State("w", 0, "-9.81")],
        components=[
            hs.Component(
                "ground",
                [hs.Mode("up", hs.Guard("down", "h", hs.Choice("up", reset={"h": "0", "w": "-0.8*w"})))],
                initial="up",
            )
        ],
    )
    options = {"step": 1e-3} if integrator.startswith("rk4") else {}
    for model, component in ((oscillator, "m"), (ball, "ground")):
        sol = hs.simulate(model, (0.0, 1.5), integrator=integrator, **options)
        times = sol.event_times(component)
        assert len(times) >= 1
        for side in ("+", "-"):
            np.testing.assert_allclose(
                sol.event_states(component, side=side), sol(times, side=side).T, rtol=0, atol=1e-9
            )
    assert sol.event_states("ground")[0, 1] == pytest.approx(0.8 * np.sqrt(2.0 * 9.81), rel=2e-3)


@pytest.mark.parametrize("integrator", ["rk4-dichotomy", "rk4-sign", "moreau", "exact", "dop853"])
def test_those_of_a_monitor_that_resets(integrator: str) -> None:
    """v+ = v- + 0.5."""
    model = hs.Model(
        "kicked",
        states=[hs.State("x", 0, "v"), hs.State("v", 1, "-f")],
        contacts=[hs.Contact("f", velocity="v", normal=1, law="coulomb", arguments={"mu": 0.05})],
        monitors=[hs.Monitor("m", "x-0.1", action="reset", reset={"v": "v+0.5"}), hs.Monitor("n", "x-0.2")],
    )
    options = {} if integrator in ("exact", "dop853") else {"step": 1e-3}
    sol = hs.simulate(model, (0.0, 0.3), integrator=integrator, **options)
    ((x, v),) = sol.event_states("m", side="-")
    assert sol.event_states("m")[0] == pytest.approx([x, v + 0.5], abs=1e-14)
    assert (x, v) == pytest.approx((0.1, np.sqrt(1.0 - 0.1 * 0.1)), abs=2e-3)
    np.testing.assert_array_equal(sol.event_states("n"), sol.event_states("n", side="-"))
    assert [event.component for event in sol.events] == ["m", "n"]
