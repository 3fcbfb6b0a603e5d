"""What the kernels of all fixed-step methods share: why a stretch of steps ends, and what a step has passed."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.engine.jit import call, inlined

# why a stretch of steps ended
BOUND, FULL, GUARD, MONITOR, NOT_FINITE, RESTITUTION = 0, 1, 2, 3, 4, 5
GOES_ON = -1


@inlined
def passed(
    functions: Any,
    s: float,
    x: Any,
    s1: float,
    x1: Any,
    p: Any,
    z: Any,
    watched: Any,
    fresh: Any,
    is_first: bool,
    guards: Any,
    before: Any,
    after: Any,
    counts: Any,
) -> int:
    """What ends the stretch at a step from (s, x) to (s1, x1), or GOES_ON.

    functions: addresses of guards and monitors. watched: guards that must not be negative. fresh: monitors that have
    just fired, what is left of whose zero is no new one on the first step. guards, before, after: room.
    """
    for i in range(x1.shape[0]):
        if not np.isfinite(x1[i]):
            return NOT_FINITE
    if watched.shape[0] > 0:
        call(functions[0], s1, x1, p, z, guards)
        counts[1] += 1
        leaves = False
        for i in range(watched.shape[0]):
            if watched[i] >= 0:
                if np.isnan(guards[watched[i]]):
                    return NOT_FINITE
                leaves = leaves or guards[watched[i]] < 0.0
        if leaves:
            return GUARD
    if fresh.shape[0] > 0:
        call(functions[1], s, x, p, z, before)
        call(functions[1], s1, x1, p, z, after)
        for k in range(fresh.shape[0]):
            changed = (before[k] > 0.0) != (after[k] > 0.0)
            if is_first and fresh[k]:
                continue
            if before[k] != 0.0 and changed and before[k] * after[k] <= 0.0:
                return MONITOR
    return GOES_ON
