"""A few sequences of `docs/studies/steps.py`: steps are the straight run with the same knots, bit for bit."""

from __future__ import annotations

import pytest

from .random_steps import KINDS, compare


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "tsit5"])
@pytest.mark.parametrize("kind", KINDS)
def test_random_sequences_are_the_straight_run(kind: str, integrator: str) -> None:
    if (kind, integrator) == ("pendulum", "exact"):
        pytest.skip("exact needs linear modes")
    for seed in range(3):
        found = compare(kind, integrator, seed)
        assert found.is_equal and found.difference < 1e-12, found
        assert found.has_same_modes
