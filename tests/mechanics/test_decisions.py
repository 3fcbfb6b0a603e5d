"""Decisions of coupled contacts: against all combinations tried in 40 digits, in any order of declaration."""

from __future__ import annotations

import numpy as np
import pytest
from mechanics.enumeration import Enumeration
from mechanics.random_systems import LAWS, random_system, reordered

import hybridsim as hs

MODES = {"stick": 0, "slip+": 1, "slip-": -1}


@pytest.mark.parametrize("law", LAWS)
# 17: two in one direction stop together
@pytest.mark.parametrize(("seed", "span"), [(4, 6.0), (9, 6.0), (17, 10.0)])
def test_every_decision_is_admissible_and_the_order_of_declaration_is_none_of_them(
    law: str, seed: int, span: float
) -> None:
    system = random_system(seed, law)
    sol = hs.simulate(system, (0, span), rtol=1e-11)
    assert sol.success
    other, dofs = reordered(system, seed)
    moved = hs.simulate(other, (0, span), rtol=1e-11)
    assert moved.x_end == pytest.approx(sol.x_end[np.r_[dofs, system.n + dofs]], abs=1e-11)
    trials = Enumeration(system)
    for t in {e.t for e in sol.events}:
        x = sol(t)
        at_rest, admissible, _ = trials.admissible(t, x[: system.n], x[system.n :])
        names = [system.contacts[c].name for c in at_rest]
        found = tuple(MODES[next(m.mode for m in reversed(sol.modes[c]) if m.t0 <= t)] for c in names)
        assert found in admissible, (t, names)


def test_two_contacts_in_one_direction_share_the_load() -> None:
    """They stick up to the sum of their limits, whatever each alone would do: the closed form of one contact."""
    both = [
        hs.MechanicalContact(f"f{i}", [1.0], load, "coulomb", {"mu": 1.0}) for i, load in ((1, 0.2), (2, 0.5))
    ]
    one = [hs.MechanicalContact("f", [1.0], 0.7, "coulomb", {"mu": 1.0})]
    pull = [hs.Harmonic(0.5, sin=1.0)]
    shared, single = (
        hs.simulate(hs.MechanicalSystem([1.0], None, None, pull, c), (0, 30)) for c in (both, one)
    )
    t = np.linspace(0, 30, 301)
    assert shared(t) == pytest.approx(single(t), abs=1e-12)
    released = next(e.t for e in shared.events if e.source == "stick" and e.target != "stick")
    assert released == pytest.approx(np.arcsin(0.7) / 0.5, abs=1e-12)
    assert shared.output("f1", 0.5) == pytest.approx(0.5 * np.sin(0.25))  # of least norm: half of it each


def test_no_admissible_combination_names_contacts_and_condition() -> None:
    rising = hs.FrictionLaw("rising", slip="2*N", stick="N")
    contacts = [hs.MechanicalContact("heel", [1.0], 1.0, rising)]
    sol = hs.simulate(hs.MechanicalSystem([1.0], None, None, [hs.Harmonic(1.0, sin=1.5)], contacts), (0, 5))
    assert sol.status == "inconsistent"
    assert sol.t_end == pytest.approx(np.arcsin(1 / 1.5), abs=1e-9)
    assert "heel" in sol.message
    assert "above its stick limit" in sol.message
