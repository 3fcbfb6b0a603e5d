"""A mechanical system and the same as an ordinary model, whose modes are decided by trying all combinations."""

from __future__ import annotations

import numpy as np
import pytest
from mechanics.random_systems import random_system

import hybridsim as hs


def states_of_model(system: hs.MechanicalSystem) -> list[int]:
    """Where the model has positions and velocities: it has them by turns."""
    return [*range(0, 2 * system.n, 2), *range(1, 2 * system.n, 2)]


@pytest.mark.parametrize(
    "system",
    [hs.two_blocks_on_belt(), hs.three_coupled_blocks(), random_system(8, "static-kinetic", 3)],
    ids=lambda system: system.name,
)
def test_same_motion_and_events(system: hs.MechanicalSystem) -> None:
    sol = hs.simulate(system, (0, 15), rtol=1e-12)
    ref = hs.simulate(system.to_model(), (0, 15), integrator="taylor", rtol=1e-12)
    assert [(e.component, e.source, e.target) for e in sol.events] == [
        (e.component, e.source, e.target) for e in ref.events
    ]
    assert [e.t for e in sol.events] == pytest.approx([e.t for e in ref.events], abs=1e-8)
    t = np.linspace(0, 15, 101)
    assert sol(t) == pytest.approx(ref(t)[states_of_model(system)], abs=1e-9)
    for contact in system.contacts:
        assert sol.output(contact.name, t + 1e-3 * (t < 1)) == pytest.approx(
            ref.output(contact.name, t + 1e-3 * (t < 1)), abs=1e-7
        )


def test_one_block_is_the_scene_belt() -> None:
    """The period of the stick-slip cycle is 12.0010 (model belt, whose source gives the closed form)."""
    sol = hs.simulate(hs.chain_on_belt(1, coupling=0.0), (0, 50))
    released = [e.t for e in sol.events if e.source == "stick"]
    assert np.diff(released) == pytest.approx(12.0010313, abs=1e-6)
