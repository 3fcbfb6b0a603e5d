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
    sol = hs.simulate(model, (0.0, end), save=save, **options)
    again = hs.simulate(model, (0.0, end), save=save, **options)
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
    with pytest.raises(hs.UsageError, match="side is 'x'"):
        sol.event_states("f", side="x")
    with pytest.raises(hs.UsageError, match="no component"):
        sol.event_states("g")
