"""This module computes what compiled loops need to judge modes: Taylor series of guards, and jumps of unknowns."""

from __future__ import annotations

from typing import Any

from hybridsim.engine.events.choice.verdict import RELEASED, UNCHANGED, is_smooth, kind_of_change
from hybridsim.engine.events.compiled.scratch import SERIES, called_by
from hybridsim.engine.linear.guard_coefficients import has_tables
from hybridsim.engine.native.kernels import array_at, call, call_kernel, call_series, inlined, kernel_address
from hybridsim.engine.series.bounded import run_series


def interpreted_series(
    tapes: Any, inputs: Any, k: int, s: float, s_error: float, x: Any, x_error: Any, p: Any, work: Any
) -> int:
    """Compute `guard_series` with the interpreter of instruction tapes.

    Compiled code calls this kernel by its address.
    """
    judged, V, E = work.judged, work.V, work.E
    constant = tapes.constant[tapes.constant_start[k] : tapes.constant_start[k + 1]]
    rows = tapes.optimised[tapes.optimised_start[k] : tapes.optimised_start[k + 1]]
    n, size = work.y.shape[0], work.p_after.shape[0]
    state, bounds, vector = array_at(x, n), array_at(x_error, n), array_at(p, size)
    run_series(constant, rows, inputs, tapes.derivatives[k], s, s_error, state, bounds, vector, V, E)
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        g = tapes.active[i]
        r = tapes.guards[k, g]
        for j in range(judged.shape[2]):
            judged[0, g, j], judged[1, g, j] = V[r, j], E[r, j]
    return 0


def link_interpreted_series(tapes: Any, inputs: Any, state: Any, work: Any) -> None:
    """Compile `interpreted_series`, and store its address for other kernels."""
    x = work.y
    work.entry_points[SERIES] = kernel_address(
        interpreted_series, tapes, inputs, 0, 0.0, 0.0, x, x, state.p, work
    )


@inlined
def guard_series(tapes: Any, inputs: Any, lin: Any, k: int, at: Any, x: Any, x_error: Any, work: Any) -> None:
    """Write the Taylor coefficients of the active guards to third order, with error bounds.

    For linear modes these are rows over states and functions of time, and a verdict computes only those that decide.
    """
    if has_tables(lin):
        return
    if tapes.bounds[k] != 0:
        call_series(tapes.bounds[k], at.s, at.s_error, x, x_error, at.p, work.judged)
        return
    tapes.lacked[k] += 1
    call_kernel(work.entry_points[SERIES], (tapes, inputs, k, at.s, at.s_error, x, x_error, at.p, work))


@inlined
def is_continuous(automata: Any, at: Any, z: Any, members: Any, work: Any) -> bool:
    """Return whether every change of mode of some components is a release at which no unknown jumps."""
    kind = kind_of_change(automata, work, z, members)
    if kind == RELEASED:
        call(called_by(work).jumps, at.s, work.x_after, at.p, z, work.jumps)
        return is_smooth(automata, work, z, members, work.jumps)
    return kind == UNCHANGED
