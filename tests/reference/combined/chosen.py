"""Which structures a study takes: first such as bring rare pairs of forms together, then as they are drawn."""

from __future__ import annotations

from collections import Counter
from itertools import combinations

from .trial import features

ENOUGH = 14  # structures that a pair of forms is to be in; more than are asked for, as some say nothing
POOL = 60  # structures that one is chosen from
LEAST = 1  # what one must bring towards that to be chosen
STEERED = 100_000  # seeds from here on are for those that are chosen


def forms(seed: int) -> list[str]:
    """The forms of a structure, in order."""
    return sorted(f for f in features(seed) if not f.startswith("part: "))


def chosen_seeds(count: int) -> list[int]:
    """The seeds of that many structures, always the same ones.

    Each of the first is the one of a pool that has the rarest pairs; when all pairs come often enough the others follow
    as they are drawn.
    """
    seen: Counter[tuple[str, str]] = Counter()
    out: list[int] = []
    following = STEERED
    while len(out) < count:
        pool = {seed: list(combinations(forms(seed), 2)) for seed in range(following, following + POOL)}
        following += POOL
        gain = {seed: sum(max(0, ENOUGH - seen[pair]) for pair in pool[seed]) for seed in pool}
        best = max(pool, key=gain.__getitem__)
        if gain[best] < LEAST:
            break
        seen.update(pool[best])
        out.append(best)
    return out + list(range(count - len(out)))
