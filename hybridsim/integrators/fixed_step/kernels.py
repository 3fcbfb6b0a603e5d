"""This module contains the kernels that all fixed-step methods share."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import Precompiled, call, inlined, kernel

# reasons why a sequence of steps ended
BOUND, FULL, GUARD, MONITOR, NOT_FINITE, RESTITUTION, RESTED = 0, 1, 2, 3, 4, 5, 6
CONTINUES = -1


@inlined
def leaves_side(before: float, after: float) -> bool:
    """Return whether a monitor changes from a positive or negative value to zero or to the other sign."""
    return (before > 0.0 and after <= 0.0) or (before < 0.0 and after >= 0.0)


@inlined
def brought_to_zero(
    address: Any, s: float, x: Any, p: Any, z: Any, fresh: Any, is_first: bool, before: Any, after: Any
) -> bool:
    """Return whether new modes at the start of a step, and not the motion, made a monitor zero or changed its sign.

    address: the monitors' function, whose values are written to before; after: their values at the end of the
    last step. Monitors for which this holds are marked in fresh.
    """
    found = False
    if fresh.shape[0] > 0:
        call(address, s, x, p, z, before)
        for k in range(fresh.shape[0]):
            if not is_first and leaves_side(after[k], before[k]):
                fresh[k] = True
                found = True
    return found


@inlined
def passed(
    functions: Any,
    s1: float,
    x1: Any,
    p: Any,
    z: Any,
    guard_numbers: Any,
    fresh: Any,
    is_first: bool,
    guards: Any,
    before: Any,
    after: Any,
    counts: Any,
) -> int:
    """Return the reason to end the loop after a step, or CONTINUES.

    functions: addresses of guards and monitors. guard_numbers: guards that must not be negative. fresh: monitors
    that have just fired, whose remaining zero on the first step is not a new one. before: monitor values at
    the start of the step. guards, after: scratch space.
    """
    for i in range(x1.shape[0]):
        if not np.isfinite(x1[i]):
            return NOT_FINITE
    if guard_numbers.shape[0] > 0:
        call(functions[0], s1, x1, p, z, guards)
        counts[1] += 1
        leaves = False
        for i in range(guard_numbers.shape[0]):
            if guard_numbers[i] >= 0:
                if np.isnan(guards[guard_numbers[i]]):
                    return NOT_FINITE
                leaves = leaves or guards[guard_numbers[i]] < 0.0
        if leaves:
            return GUARD
    if fresh.shape[0] > 0:
        call(functions[1], s1, x1, p, z, after)
        for k in range(fresh.shape[0]):
            if leaves_side(before[k], after[k]) and not (is_first and fresh[k]):
                return MONITOR
    return CONTINUES


@kernel
def _changed_rows(before: Any, modes: Any, rows: Any) -> int:
    """Write the indices of the rows at which modes change, and return how many there are."""
    count, components, flat = 0, before.shape[0], modes.reshape(modes.size)
    for k in range(flat.shape[0]):
        source = before[k] if k < components else flat[k - components]
        if flat[k] != source and (count == 0 or rows[count - 1] != k // components):
            rows[count] = k // components
            count += 1
    return count


_write_rows = Precompiled(_changed_rows)


def changed_rows(before: np.ndarray, modes: np.ndarray) -> np.ndarray:
    """Return the indices of the rows at which modes change; `before` contains the earlier modes."""
    rows = np.empty(len(modes), dtype=np.int64)
    return rows[: _write_rows(before, modes, rows)].copy()
