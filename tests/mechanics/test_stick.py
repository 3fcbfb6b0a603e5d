"""Stick over many periods, work of friction, series of parts, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mechanics.random_systems import random_system
from numpy.polynomial.legendre import leggauss

import hybridsim as hs


def test_a_single_block_at_rest_moves_by_no_bit_in_1e5_periods() -> None:
    period = 2 * math.pi / 1.3
    stuck = hs.MechanicalContact("f", [1.0], 1.0, "coulomb", {"mu": 0.5})
    system = hs.MechanicalSystem([1.0], [0.05], [1.0], [hs.Harmonic(1.3, sin=0.3)], [stuck], q0=[0.1])
    sol = hs.simulate(system, (0, 1e5 * period), save="nothing")
    assert sol.success
    assert sol.x_end.tolist() == [0.1, 0.0]
    assert sol.stats["events"] == 0


def test_constraints_over_several_coordinates_hold_to_4_ulp_and_do_not_grow() -> None:
    rng = np.random.default_rng(0)
    W = rng.normal(size=(2, 3))
    contacts = [hs.MechanicalContact(f"f{i}", W[i], 50.0, "coulomb", {"mu": 0.9}) for i in range(2)]
    mass = np.eye(3) + 0.2 * W.T @ W
    forcing = [hs.Harmonic(1.3, sin=0.5), 0, hs.Harmonic(0.7, sin=0.5)]
    sol = hs.simulate(hs.MechanicalSystem(mass, [0.1] * 3, [1.0] * 3, forcing, contacts), (0, 2e3), rtol=1e-6)
    assert all(m.mode == "stick" for c in contacts for m in sol.modes[c.name])
    for first in (100.0, 1900.0):
        velocities = sol(np.linspace(first, first + 100, 300))[3:]
        assert abs(velocities).max() > 0.01  # one way to move is left
        terms = W[:, :, None] * velocities
        assert (abs(terms.sum(axis=1)) <= 4 * np.spacing(abs(terms).sum(axis=1))).all()


@pytest.mark.parametrize("seed", [3, 8])
def test_work_of_friction_is_the_loss_of_energy(seed: int) -> None:
    system = random_system(seed, "coulomb", 6)
    free = system.with_(C=None, forcing=None)
    sol = hs.simulate(free, (0, 10), rtol=1e-12)
    nodes, weights = leggauss(12)
    knots = np.unique(sol.t)
    t = (0.5 * np.add.outer(np.diff(knots), np.zeros(12)) + knots[:-1, None]) + 0.5 * np.outer(
        np.diff(knots), nodes
    )
    velocity = sol(t.ravel())[free.n :]
    W = np.zeros((len(free.contacts), free.n))
    for c, contact in enumerate(free.contacts):
        for i, w in contact.direction:
            W[c, i] += w
    power = sum(sol.output(c.name, t.ravel()) * (W[k] @ velocity) for k, c in enumerate(free.contacts))
    work = (power.reshape(t.shape) @ weights * 0.5 * np.diff(knots)).sum()

    def energy(x: np.ndarray) -> float:
        q, v = np.split(x, 2)
        return float(0.5 * v @ (free.M @ v) + 0.5 * q @ (free.K @ q))

    lost = energy(sol(0.0)) - energy(sol(10.0))
    assert work == pytest.approx(lost, rel=1e-9, abs=1e-9 * energy(sol(0.0)))


def test_restarting_parts_is_as_good_as_restarting_everything() -> None:
    """A chain with its series of parts, and closely the same as one node, where every event restarts all."""
    chain = hs.chain_on_belt(30)
    sol = hs.simulate(chain, (0, 4), rtol=1e-11)
    # a hair of common mass makes one node of the chain
    tied = chain.with_(M=np.eye(30) + 1e-14 * (np.eye(30, k=1) + np.eye(30, k=-1)))
    ref = hs.simulate(tied, (0, 4), rtol=1e-11)
    assert sol.stats["nodes_restarted"] > sol.stats["restarts"] > 20
    assert ref.stats["restarts"] == 0
    assert [e.component for e in sol.events] == [e.component for e in ref.events]
    assert [e.t for e in sol.events] == pytest.approx([e.t for e in ref.events], abs=1e-9)
    assert sol(4.0) == pytest.approx(ref(4.0), abs=1e-9)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"integrator": "dop853"}, "dop853 does not run a MechanicalSystem"),
        ({"t_span": (1, 0)}, "forward only"),
        ({"z0": {"f1": "stick"}}, "z0 is given"),
        ({"save": 3.0}, "save is 3.0"),
        ({"x0": {"w": 1.0}}, "names 'w'"),
        ({"tolerance": 1e-3}, "tolerance is given"),
    ],
)
def test_what_it_does_not_take_is_refused_with_a_remedy(changes: dict, said: str) -> None:
    arguments = {"t_span": (0, 1)} | changes
    with pytest.raises(hs.UsageError, match=said):
        hs.simulate(hs.two_blocks_on_belt(), **arguments)


def test_what_is_no_mechanical_system_is_refused() -> None:
    with pytest.raises(hs.UsageError, match="not positive definite"):
        hs.simulate(hs.MechanicalSystem([[1.0, 2.0], [2.0, 1.0]], None, None), (0, 1))
    with pytest.raises(hs.UsageError, match="two things are called 'q1'"):
        hs.MechanicalSystem(
            [1.0], None, None, None, [hs.MechanicalContact("q1", [1.0], 1, "coulomb", {"mu": 1})]
        )
    with pytest.raises(hs.UsageError, match="a force of its own"):
        hs.MechanicalContact("f", [1.0], 1, "lugre")
