"""The package's closed form and the one of the tests, written apart: the same motion by two routes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hybridsim.reference.closed_forms.forced_coulomb_oscillator import ForcedCoulombOscillator
from reference.arithmetic import multiprecision
from reference.dfcs_closed_form import Oscillator

MODE = {0: "stick", 1: "slip+", -1: "slip-"}
NATURAL = math.sqrt(1e5 / 0.2)


def both(m, c, k, static, kinetic, force, w, t_end, x0=0.0, v0=0.0, **numbers):
    ours = ForcedCoulombOscillator(m, c, k, kinetic, static, force, w).motion(x0, v0, (0.0, t_end))
    theirs = Oscillator(m, c, k, static, kinetic, force, w, **numbers).run(0.0, t_end, x0, v0)
    return ours, theirs


@pytest.mark.parametrize("r, force, count", [(0.6, 30.0, 401), (0.64, 22.0, 400)])
def test_published_cases_over_a_hundred_periods(r: float, force: float, count: int) -> None:
    period = 2 * math.pi / (r * NATURAL)
    ours, theirs = both(
        0.2, 5.65, 1e5, 20.0, 20.0, force, r * NATURAL, 100 * period, numbers=multiprecision(30)
    )
    assert len(ours.changes) == len(theirs.changes) == count
    for change, other in zip(ours.changes, theirs.changes):
        assert change.target == MODE[other.mode]
        assert abs(change.t - other.t) < 1e-13 * period
        assert abs(change.x - other.x) < 1e-18  # amplitude 4e-4


def test_random_systems() -> None:
    rng = np.random.default_rng(11)
    changes = 0
    for _ in range(60):
        m, k, force, w = rng.uniform([0.5, 0.5, 0.5, 0.2], [2, 3, 2, 2.5])
        c = rng.uniform(0, 0.8) * math.sqrt(m * k)
        kinetic = rng.uniform(0.05, 0.99) * force
        static = kinetic * rng.choice([1.0, 1.0, 1.3])
        ours, theirs = both(m, c, k, static, kinetic, force, w, 60.0, *rng.uniform(-2, 2, 2))
        assert [change.target for change in ours.changes] == [MODE[other.mode] for other in theirs.changes]
        changes += len(ours.changes)
        for change, other in zip(ours.changes, theirs.changes):
            assert (change.t, change.x) == pytest.approx((other.t, other.x), abs=1e-10)
    assert changes > 800
