"""Stick over many periods, work of friction, series of parts, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mechanics.energy import balance
from mechanics.random_systems import LAWS, random_system
from mechanics.stuck_systems import FORCING, stuck_system, ulps_off

import hybridsim as hs


def test_a_single_block_at_rest_moves_by_no_bit_in_1e5_periods() -> None:
    period = 2 * math.pi / 1.3
    stuck = hs.MechanicalContact("f", [1.0], 1.0, "coulomb", {"mu": 0.5})
    system = hs.MechanicalSystem([1.0], [0.05], [1.0], [hs.Harmonic(1.3, sin=0.3)], [stuck], q0=[0.1])
    sol = hs.simulate(system, (0, 1e5 * period), keep="nothing")
    assert sol.success
    assert sol.x_end.tolist() == [0.1, 0.0]
    assert sol.stats["events"] == 0


@pytest.mark.parametrize("base", [0.0, 0.2])
def test_constraints_over_several_coordinates_hold_to_4_ulp_and_do_not_grow(base: float) -> None:
    """As read from the run, and as the integrator itself has them; 1e5 periods: docs/studies/long_runs.py."""
    system, period = stuck_system(base), 2 * math.pi / FORCING
    sol = hs.simulate(system, (0, 1e4 * period), rtol=1e-6)
    assert all(m.mode == "stick" for c in system.contacts for m in sol.modes[c.name])
    for first in (100, 9900):
        states = sol(np.linspace(first * period, (first + 100) * period, 300))
        assert np.ptp(states[3:], axis=1).max() > 0.01  # one way to move is left
        assert ulps_off(system, states) <= 4
    ends = [sol, *(hs.simulate(system, (0, n * period), rtol=1e-6, keep="nothing") for n in range(100, 110))]
    assert ulps_off(system, np.array([run.x_end for run in ends]).T) <= 4


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("seed", [3, 8])
def test_work_of_friction_is_the_loss_of_energy(seed: int, law: str) -> None:
    """With forcing and damping, moving bases too; all 60 systems of each law: docs/studies/coupled_contacts.py."""
    sol = hs.simulate(random_system(seed, law, 6), (0, 10), rtol=1e-12)
    found = balance(sol)
    assert len(sol.events) > 5 and found.dissipated > 0.1
    assert found.miss <= 1e-9
    assert found.friction == pytest.approx(balance(sol, 16).friction, rel=1e-11)  # the quadrature's own error
    unforced = hs.simulate(random_system(seed, law, 6).with_(C=None, forcing=None), (0, 10), rtol=1e-12)
    alone = balance(unforced)
    assert alone.friction == pytest.approx(-alone.gained, rel=1e-9, abs=1e-9 * alone.dissipated)


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
        ({"integrator": "dop853"}, "dop853 cannot simulate a MechanicalSystem"),
        ({"t_span": (1, 0)}, "forward only"),
        ({"z0": {"f1": "stick"}}, "does not support `z0`"),
        ({"keep": 3.0}, "`keep` cannot be 3.0"),
        ({"x0": {"w": 1.0}}, "contains 'w'"),
        ({"tolerance": 1e-3}, "`tolerance` is an option of moreau"),
    ],
)
def test_what_it_does_not_take_is_refused_with_a_remedy(changes: dict, said: str) -> None:
    arguments = {"t_span": (0, 1)} | changes
    with pytest.raises(hs.UsageError, match=said):
        hs.simulate(hs.two_blocks_on_belt(), **arguments)


def test_what_is_no_mechanical_system_is_refused() -> None:
    with pytest.raises(hs.UsageError, match="not positive definite"):
        hs.simulate(hs.MechanicalSystem([[1.0, 2.0], [2.0, 1.0]], None, None), (0, 1))
    with pytest.raises(hs.UsageError, match="the name 'q1' is used twice"):
        hs.MechanicalSystem(
            [1.0], None, None, None, [hs.MechanicalContact("q1", [1.0], 1, "coulomb", {"mu": 1})]
        )
    with pytest.raises(hs.UsageError, match="a direct force"):
        hs.MechanicalContact("f", [1.0], 1, "lugre")
