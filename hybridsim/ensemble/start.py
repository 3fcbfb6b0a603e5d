"""This module examines starts: whether contacts oppose their velocities, and whether a state rests."""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.linear.motion import functions_of_time, to_modal
from hybridsim.engine.native.kernels import call, inline_always, kernel
from hybridsim.engine.native.simd.products import LANES
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.programs.modes_index import find_modes


@inline_always
def keeps_holding(tapes: Any, lin: Any, state: Any, work: Any, c: Any) -> bool:
    """Return whether nothing moves any more: all states are constant, and no guard passes zero.

    A guard that reaches zero and turns back there, within its rounding, leaves the mode unchanged. Functions of time
    are taken at the origin of the state. c: scratch for modal coordinates.
    """
    x, z, p = state.x, state.z, state.p
    k = find_modes(tapes, z)
    if k < 0:
        return False
    functions_of_time(lin, 0.0, p, work.factors, work.w)
    for m in range(lin.slopes.shape[2]):
        for q in range(lin.slopes.shape[1]):
            for i in range(LANES):
                if lin.slopes[k, q, m, i] != 0.0 and (m >= x.shape[0] or x[m] != 0.0):
                    return False  # the state moves or is forced
    to_modal(lin, k, x, work.w, c)
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        g = tapes.active[i]
        turning = lin.waves[k, g]
        level = size = 0.0
        for j in range(lin.counts[k]):
            size += lin.sizes[k, g, j] * (abs(c[j].real) + abs(c[j].imag))
            if j != turning:
                if lin.sizes[k, g, j] != 0.0 and lin.values[k, j] != 0.0:
                    return False  # neither constant nor one sine wave
                level += lin.terms[k, g, j, 0, 0] * c[j].real - lin.terms[k, g, j, 1, 0] * c[j].imag
        radius = 0.0
        if turning >= 0:
            u, v = lin.terms[k, g, turning, 0, 0], lin.terms[k, g, turning, 1, 0]
            radius = math.hypot(
                u * c[turning].real - v * c[turning].imag, u * c[turning].imag + v * c[turning].real
            )
        if not level - radius >= -(16.0 + 2.0 * lin.counts[k]) * UNIT * size or not level > 0.0:
            return False
    return True


@kernel
def opposing(effects: Any, x: Any, p: Any, z: Any, scratch: Any, out: Any) -> None:
    """Write to `out` (N,) whether every contact opposes its own velocity at the starts of N runs."""
    for i in range(x.shape[0]):
        call(effects, 0.0, x[i], p[i], z, scratch)
        out[i] = True
        for c in range(scratch.shape[0]):
            out[i] = out[i] and scratch[c] < 0.0
