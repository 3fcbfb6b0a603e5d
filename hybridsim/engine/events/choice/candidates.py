"""Enumerate the combinations of modes at the surfaces of a cluster, and test as many as the choice needs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hybridsim.engine.events.choice.verdict import FINE, LEAVES, preference

if TYPE_CHECKING:
    from hybridsim.engine.events.resolve import EventResolution


def all_verdicts(
    resolution: EventResolution, members: list[int], candidates: np.ndarray, cluster: tuple[int, ...]
) -> np.ndarray:
    """Return the verdicts on all joint candidates."""
    found = [resolution.verdict(resolution.with_modes(members, modes), cluster) for modes in candidates]
    return np.array(found, dtype=np.int64)


def verdicts_on(
    resolution: EventResolution,
    members: list[int],
    candidates: np.ndarray,
    current: np.ndarray,
    holds: np.ndarray,
    cluster: tuple[int, ...],
) -> tuple[np.ndarray, bool]:
    """Return whether each combination of modes is admissible, in order of preference, and whether all were tested.

    The search ends after the candidates that `choose` prefers as much as the first one it accepts. The others count as
    not admissible. If a member needs a unique motion, all candidates are judged.
    """
    if resolution.is_thorough or any(resolution.system.automata[c].is_unique for c in members):
        return all_verdicts(resolution, members, candidates, cluster), True
    count = len(members)
    ranks = [preference(modes, current, holds, count) for modes in candidates]
    verdicts, least = np.full(len(candidates), LEAVES, dtype=np.int64), -1
    for number in sorted(range(len(candidates)), key=ranks.__getitem__, reverse=True):
        if ranks[number] < least:
            return verdicts, False
        verdict = resolution.verdict(resolution.with_modes(members, candidates[number]), cluster)
        verdicts[number] = verdict
        if verdict == FINE or (verdict != LEAVES and ranks[number] >= count * (count + 1)):
            least = ranks[number]
    return verdicts, True
