"""Time stepping refuses a contact that is loaded by another contact's friction, by name."""

from __future__ import annotations

import pytest

import hybridsim as hs


def wedge(load: str) -> hs.Model:
    """A contact g whose load may use the friction force f."""
    return hs.Model(
        "wedge",
        states=[hs.State("v", 1, der="-f", nominal=1), hs.State("w", 2, der="-g", nominal=1)],
        definitions={"n": load},
        contacts=[
            hs.Contact("f", "v", "1", "coulomb", {"mu": 0.5}),
            hs.Contact("g", "w", "n", "coulomb", {"mu": 0.2}),
        ],
    )


@pytest.mark.parametrize("load", ["3 + f", "max(3 + 2*f, 0)"])
def test_a_load_that_follows_another_friction_force_is_refused(load: str) -> None:
    with pytest.raises(hs.UsageError, match="friction forces: the load of g depends on f"):
        hs.simulate(wedge(load), (0, 1), integrator="moreau", step=1e-3)


def test_the_integrators_that_are_named_take_it() -> None:
    # f = 1/2 while v falls from 1 to 0 at t = 2, and 0 after it: w falls by 0.2 times the load
    for name in ("exact", "taylor", "dop853"):
        solution = hs.simulate(wedge("3 + f"), (0, 2.5), integrator=name)
        assert solution(2.5) == pytest.approx([0.0, 2.0 - 0.2 * (3.5 * 2.0 + 3.0 * 0.5)], rel=1e-9)


def test_a_load_of_states_is_taken() -> None:
    solution = hs.simulate(wedge("3 + v"), (0, 1), integrator="moreau", step=1e-3)
    assert solution(1.0)[1] == pytest.approx(2.0 - 0.2 * (3.0 + 0.75), abs=1e-3)
