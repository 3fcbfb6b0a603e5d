"""This module judges the combinations of modes of coupled components, and chooses one of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybridsim.engine.events.choice.event_verdicts import EventVerdicts
from hybridsim.engine.events.choice.joint_choice import (
    NO_SCORE,
    NONE,
    is_settled,
    joint_choice,
    rank_candidates,
)
from hybridsim.engine.native.kernels import Precompiled

_UNJUDGED = -2  # there is no verdict on a candidate yet
_rank_candidates, _joint_choice, _is_settled = map(Precompiled, (rank_candidates, joint_choice, is_settled))


class JudgedCandidates(NamedTuple):
    """The combinations of modes to choose from, the verdicts so far, and the chosen combination."""

    candidates: np.ndarray  # modes (k, members)
    verdicts: np.ndarray  # (k,)
    number: int  # of the chosen candidate, or NONUNIQUE or NONE


def judged_candidates(
    resolution: EventVerdicts,
    members: list[int],
    candidates: np.ndarray,
    keeps: np.ndarray,
    cluster: tuple[int, ...],
) -> JudgedCandidates:
    """Judge combinations of modes and choose one; contacts in the mask `keeps` stay in their holding modes.

    If a member needs a unique motion, all candidates are judged.
    """
    automata, count = resolution.system.automata, len(members)
    holds = np.array([automata[c].hold for c in members])
    # at a start, a contact prefers to hold: static friction holds one that is at its limit within rounding
    begins = [resolution.at.z[c] < 0 and not automata[c].is_unique for c in members]
    current, ranks = np.where(begins, holds, resolution.at.z[members]), np.empty(len(candidates), np.int64)
    _rank_candidates(candidates, len(candidates), count, current, holds, keeps, ranks)
    candidates, ranks = candidates[ranks >= 0], ranks[ranks >= 0]
    verdicts, chosen, score = np.full(len(candidates), _UNJUDGED, dtype=np.int64), NONE, NO_SCORE
    is_thorough = resolution.is_thorough or any(automata[c].is_unique for c in members)
    order = np.arange(len(ranks)) if is_thorough else np.argsort(-ranks, kind="stable")
    for number in order.tolist():
        rank = int(ranks[number])
        if not is_thorough and _is_settled(score, rank, count):
            break
        z = resolution.with_modes(members, candidates[number])
        verdicts[number] = verdict = resolution.verdict(z, cluster)
        chosen, score = _joint_choice(chosen, score, number, rank, verdict, count)
    return JudgedCandidates(candidates, verdicts, chosen)


def completed(
    resolution: EventVerdicts, members: list[int], found: JudgedCandidates, cluster: tuple[int, ...]
) -> np.ndarray:
    """Judge the combinations of modes that have no verdict yet, and return the verdicts on all combinations."""
    for number in np.flatnonzero(found.verdicts == _UNJUDGED):
        z = resolution.with_modes(members, found.candidates[number])
        found.verdicts[number] = resolution.verdict(z, cluster)
    return found.verdicts


def all_verdicts(
    resolution: EventVerdicts, members: list[int], candidates: np.ndarray, cluster: tuple[int, ...]
) -> np.ndarray:
    """Return the verdicts on all given combinations of modes."""
    verdicts = np.full(len(candidates), _UNJUDGED, dtype=np.int64)
    return completed(resolution, members, JudgedCandidates(candidates, verdicts, 0), cluster)
