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


def test_the_texts_of_the_model_have_no_empty_signs() -> None:
    system = hs.MechanicalSystem(
        [2, 1],
        None,
        [[30, -15], [-15, 15]],
        forcing=[hs.Harmonic(omega=3, sin=4, cos=-2), -5.0],
        contacts=[
            hs.MechanicalContact("f1", [1, 0], 10, "coulomb", {"mu": 0.3}, base=0.5),
            hs.MechanicalContact("f2", [-1, 0.5], 10, "coulomb", {"mu": 0.3}),
        ],
        impacts=[hs.MechanicalImpact("p", [0, -1], gap=-0.25, restitution=0.5)],
    )
    model = system.to_model()
    rates = [state.der.text for state in model.states]
    assert rates == [
        "v1",
        "0.5*(4*sin(omega_1*t) - 2*cos(omega_1*t)) - 15*q1 + 7.5*q2 - 0.5*f1 + 0.5*f2",
        "v2",
        "-5 + 15*q1 - 15*q2 - 0.5*f2 - p",
    ]
    assert [contact.velocity.text for contact in model.contacts] == ["v1 - 0.5", "-v1 + 0.5*v2"]
    assert model.impacts[0].gap.text == "-q2 - 0.25"
    assert hs.MechanicalSystem([1.0], None, [0.0]).to_model().states[1].der.text == "0"
