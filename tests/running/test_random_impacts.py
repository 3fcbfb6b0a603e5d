"""Random impacts with nonlinear gaps in several positions keep momentum, angular momentum and energy."""

from __future__ import annotations

import pytest
from reference.random_impacts import trial


def test_an_impact_with_a_curved_gap_changes_velocities_alone():
    done, faults = trial(seed=7, each=12, names_of=("wall", "curved-3", "two-at-once"))
    assert done == 36
    assert not faults, "\n".join(faults[:5])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_a_thousand_impacts_in_2_to_6_positions_keep_what_impacts_keep(seed):
    done, faults = trial(seed, each=25)
    assert done == 275
    assert not faults, "\n".join(faults[:5])
