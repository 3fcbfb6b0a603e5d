"""Choose the modes of several components at one instant, by verdicts on combinations of modes.

The current modes stay if they are admissible or undecided. Otherwise the certainly admissible combination with the
highest rank is chosen: unchanged modes count first, then holding modes, because static friction holds. Undecided
combinations are chosen only if none is certain. A tie has no unique motion.

Who chooses judges the candidates in the order of their ranks, until `is_settled`, and passes each verdict to
`joint_choice`.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any

import numpy as np

from hybridsim.engine.events.choice.verdict import FINE, LEAVES
from hybridsim.engine.native.kernels import inlined, kernel

NONUNIQUE, NONE = -1, -2  # outcomes of a choice that names no candidate
NO_SCORE = -1  # score of a choice without a candidate
NO_CAUSE = -1  # rank of a candidate in which a component below its limits leaves its holding mode


@inlined
def is_below_limit(automata: Any, event: Any, c: int) -> bool:
    """Return whether the force of contact `c` is certainly below its limits, by the series of its holding mode."""
    for j in range(automata.guards_of.shape[2]):
        g = automata.guards_of[c, automata.hold[c], j]
        if g >= 0 and not event.judged[0, g, 0] > event.judged[1, g, 0]:
            return False
    return True


@kernel
def rank_candidates(
    modes: Any, total: int, count: int, current: Any, holds: Any, keeps: Any, ranks: Any
) -> None:
    """Write the rank of each combination of modes, or NO_CAUSE for one that releases a contact below its limit force.

    modes (total, count): the candidates, one row each. current, holds (count,): the current and the holding modes.
    keeps (count,): contacts below their limits, which have no cause to leave their holding modes. Static friction above
    kinetic friction makes several combinations admissible, because the release of one contact changes the force on
    another.
    """
    for c in range(total):
        unchanged, held, has_cause = 0, 0, True
        for i in range(count):
            unchanged += modes[c, i] == current[i]
            held += modes[c, i] == holds[i]
            has_cause = has_cause and (modes[c, i] == holds[i] or not keeps[i])
        ranks[c] = rank_of(unchanged, held, count) if has_cause else NO_CAUSE


@inlined
def rank_of(unchanged: int, held: int, count: int) -> int:
    """Return the rank of a candidate; it increases with the numbers of unchanged modes and of holding modes."""
    return held + (count + 1) * unchanged


@inlined
def is_current(rank: int, count: int) -> bool:
    """Return whether a candidate with the given rank changes no mode."""
    return rank >= count * (count + 1)


@inlined
def joint_choice(
    chosen: int, score: int, number: int, rank: int, verdict: int, count: int
) -> tuple[int, int]:
    """Return the best candidate so far and its score, after one more candidate has been judged.

    The choice is NONUNIQUE if two candidates share the highest score.
    """
    if verdict == LEAVES:
        return chosen, score
    most = (count + 1) * (count + 1)  # more than any rank
    own = 2 * most if is_current(rank, count) else rank + (most if verdict == FINE else 0)
    if own > score:
        return number, own
    return (NONUNIQUE if own == score else chosen), score


@inlined
def is_settled(score: int, rank: int, count: int) -> bool:
    """Return whether candidates with the given rank or lower ranks cannot change the choice any more."""
    return score - (count + 1) * (count + 1) > rank


def joint_candidates(sizes: Iterable[int]) -> np.ndarray:
    """Return all combinations of modes of a cluster, one per row; the array must not be modified."""
    return _joint(tuple(sizes))


@cache
def _joint(sizes: tuple[int, ...]) -> np.ndarray:
    grid = np.indices(sizes).reshape(len(sizes), -1).T
    return np.ascontiguousarray(grid, dtype=np.int64)
