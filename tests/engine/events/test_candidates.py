"""Verdicts on as many candidates as a choice needs lead to the choice that all verdicts lead to."""

from __future__ import annotations

from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hybridsim.engine.events.choice.candidates import judged_candidates
from hybridsim.engine.events.choice.joint_choice import joint_candidates
from hybridsim.engine.events.choice.verdict import FINE, LEAVES, UNDECIDED

HOLD = 1  # of three modes


def _settling(
    current: tuple[int, ...], table: dict[tuple[int, ...], int], *, thorough: bool, unique: bool = False
) -> Any:
    """What `judged_candidates` asks of a resolution, its verdicts in a table; `asked` notes which."""
    asked: list[tuple[int, ...]] = []

    def verdict(modes: np.ndarray, _: Any) -> int:
        asked.append(tuple(modes.tolist()))
        return table[asked[-1]]

    return SimpleNamespace(
        is_thorough=thorough,
        system=SimpleNamespace(automata=[SimpleNamespace(is_unique=unique, hold=HOLD)] * len(current)),
        at=SimpleNamespace(z=np.array(current)),
        with_modes=lambda _, modes: modes,
        verdict=verdict,
        asked=asked,
    )


def _chosen(current: tuple[int, ...], verdicts: tuple[int, ...], thorough: bool) -> tuple[int, int]:
    """The choice, and how many verdicts it took."""
    n = len(current)
    candidates = joint_candidates([3] * n)
    table = {tuple(row): verdict for row, verdict in zip(candidates.tolist(), verdicts, strict=True)}
    resolution = _settling(current, table, thorough=thorough)
    none = np.zeros(n, dtype=np.bool_)
    found = judged_candidates(resolution, list(range(n)), candidates, none, tuple(range(n)))
    return found.number, len(resolution.asked)


@pytest.mark.parametrize("current", [(-1,), (0,), (1,), (2,)])
def test_all_verdicts_on_one_component(current: tuple[int, ...]) -> None:
    for verdicts in product((FINE, UNDECIDED, LEAVES), repeat=3):
        assert _chosen(current, verdicts, False)[0] == _chosen(current, verdicts, True)[0]


def test_random_verdicts_on_two_components() -> None:
    rng = np.random.default_rng(7)
    fewer = 0
    for _ in range(400):
        current = tuple(rng.integers(-1, 3, 2).tolist())
        verdicts = tuple(rng.choice([FINE, UNDECIDED, LEAVES, LEAVES], 9).tolist())
        few, count = _chosen(current, verdicts, False)
        assert few == _chosen(current, verdicts, True)[0]
        fewer += count < 9
    assert fewer > 200


def test_where_a_motion_has_to_be_the_only_one_all_are_judged() -> None:
    resolution = _settling((1,), {(0,): FINE, (1,): FINE, (2,): FINE}, thorough=False, unique=True)
    judged_candidates(resolution, [0], joint_candidates([3]), np.zeros(1, dtype=np.bool_), (0,))
    assert len(resolution.asked) == 3
