"""Resolve impacts in compiled loops: one gap closes, and no other contact takes part.

The rules are those of `hybridsim.engine.events.jumps.impact`. For one contact Newton's law has the solution
P = (e |u| - u)/G, with the rate u < 0 of the gap before, the restitution e and the effect G of a unit impulse on the
rate. The general loop resolves an impact in which other contacts take part, which has no rebound or no certain one, or
whose rebounds may come to an end.
"""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.events.choice.verdict import FINE, value_of
from hybridsim.engine.events.compiled.guard_series import guard_series
from hybridsim.engine.events.compiled.resolve_surface import SURFACE_MODES, cluster_of, row_verdict
from hybridsim.engine.events.compiled.scratch import ROW, SPREAD, called_by, located, row_of
from hybridsim.engine.events.jumps.impact import CORRECTIONS
from hybridsim.engine.events.zeno.hidden_bounces import LEAST_LOSS
from hybridsim.engine.linear.guard_coefficients import has_tables, linear_coefficient, measure_point
from hybridsim.engine.native.kernels import call, inlined
from hybridsim.engine.native.loop_hints import fill, put
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.programs.modes_index import find_modes
from hybridsim.model.parts.impact import ROUNDING

_MARGIN = 0.25  # the bounds of the general loop may be four times as wide
_IMPULSE_ERROR = 8.0 * UNIT  # relative error of an impulse, and of a state that it changes


@inlined
def _coefficient(lin: Any, k: int, g: int, order: int, work: Any) -> tuple[float, float]:
    """Return a Taylor coefficient of a guard, as `guard_series` has written it, with its error bound."""
    if has_tables(lin):
        return linear_coefficient(lin, k, g, order, work.x_after, work.slopes, work)
    return work.judged[0, g, order], work.judged[1, g, order]


@inlined
def _are_clear(tapes: Any, lin: Any, k: int, fired: int, work: Any) -> bool:
    """Return whether all guards except the fired one are away from zero."""
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        g = tapes.active[i]
        if g != fired:
            value, bound = value_of(lin, k, g, work)
            if not abs(value) > work.float_slots[SPREAD] * bound:
                return False
    return True


@inlined
def _may_take_part(automata: Any, c: int, z: Any) -> bool:
    """Return whether a second contact may take part in an impact on component `c`, or may change its mode."""
    cluster = cluster_of(automata, c)
    for i in range(cluster.shape[0]):
        d = cluster[i]
        if d != c and automata.hold[d] >= 0 and z[d] == automata.hold[d]:
            return True
    for d in range(z.shape[0]):
        if automata.is_unique[d] and z[d] == automata.hold[d]:
            return True
    return False


@inlined
def _restitution(functions: Any, at: Any, q: int, speed: float, work: Any) -> float:
    """Return the restitution at surface `q`, or NaN if it is not a number between 0 and 1."""
    states, n = work.out, at.x.shape[0]  # the states, and the approach speeds at all surfaces
    fill(states, 0.0)
    for i in range(n):
        states[i] = at.x[i]
    states[n + q] = speed
    call(functions.restitutions, at.s, states, at.p, at.z, work.jumps)
    e = work.jumps[q]
    if not -ROUNDING <= e <= 1.0 + ROUNDING:
        return math.nan
    return min(max(e, 0.0), 1.0)


@inlined
def _impulse(automata: Any, functions: Any, at: Any, c: int, rate: float, rebound: float, work: Any) -> float:
    """Return the impulse of a rebound, or NaN if it changes a friction limit or the solution is not unique.

    `out` of the work space receives the output of `hybridsim.engine.lowering.impulse_rows.impulses`.
    """
    out, n, m, q = work.out, at.x.shape[0], work.jumps.shape[0] // 2, automata.surface[c]
    fill(out, 0.0)
    call(functions.impulses, at.s, at.x, at.p, at.z, out)
    effect, loads = 0.0, 2 * m * n
    for i in range(n):
        effect += out[q * n + i] * out[(m + q) * n + i]
    for r in range(m):
        if out[loads + r * m + q] != 0.0 or out[loads + (m + r) * m + q] != 0.0:
            return math.nan
    return (1.0 / effect) * (rebound - rate) if 0.0 < effect < math.inf else math.nan


@inlined
def _close_curved_gap(functions: Any, at: Any, q: int, work: Any) -> None:
    """Move `x_after` onto the surface `q` along its gradient; `trial` contains modes that hold no surface."""
    x, gaps, n, m = work.x_after, work.jumps, at.x.shape[0], work.jumps.shape[0] // 2
    slopes = work.out[2 * m * (n + m) :]  # behind the impulses
    for _ in range(CORRECTIONS):
        call(functions.surfaces, at.s, x, at.p, work.trial, gaps)
        fill(slopes, 0.0)
        call(functions.gap_slopes, at.s, x, at.p, work.trial, slopes)
        square = 0.0
        for i in range(n):
            square += slopes[q * n + i] * slopes[q * n + i]
        for i in range(n):
            x[i] -= gaps[q] / square * slopes[q * n + i]


@inlined
def _apply(automata: Any, functions: Any, at: Any, c: int, impulse: float, work: Any) -> float:
    """Write the states after an impulse with their error bounds, and return the error bound of the rate of the gap.

    A gap that is linear in a position determines this position; the impulse changes velocities only.
    """
    x, x_error, out, n, m = work.x_after, work.slopes, work.out, at.x.shape[0], work.jumps.shape[0] // 2
    trial = work.trial
    for d in range(trial.shape[0]):
        is_held = automata.hold[d] >= 0 and at.z[d] == automata.hold[d]
        trial[d] = automata.above[d] if is_held else at.z[d]
    if automata.pin[c, 0] < 0:
        _close_curved_gap(functions, at, automata.surface[c], work)
    else:
        trial[c] = automata.hold[c]
        call(functions.project, at.s, at.x, at.p, trial, x)
    for j in range(automata.pin.shape[1]):
        if automata.pin[c, j] >= 0:
            x_error[automata.pin[c, j]] = 0.0  # as accurate as the gap
    slopes, changes, error = automata.surface[c] * n, (m + automata.surface[c]) * n, 0.0
    for i in range(n):
        change = out[changes + i]
        if change != 0.0:
            share = impulse * change
            x[i] = at.x[i] + share
            bound = _IMPULSE_ERROR * (abs(at.x[i]) + abs(share) + abs(change * impulse))
            x_error[i] = at.x_error[i] + bound
        else:
            x_error[i] = max(x_error[i], UNIT * abs(x[i]))
        error += abs(out[slopes + i]) * x_error[i]
    put(at.z, trial)
    return error


@inlined
def _set_sides(automata: Any, tapes: Any, lin: Any, k: int, fired: int, work: Any) -> int:
    """Write the slip directions and the active branches of corners after an impact to `trial`; return their row, or -1.

    A corner is an `abs`, a `min` or the like, or a monitor. k: row of the modes before. Return -1 if a sign is
    uncertain, if a monitor acts, or if a guard of another kind is negative.
    """
    trial, row = work.trial, k
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        g = tapes.active[i]
        value, bound = value_of(lin, k, g, work)
        if g == fired or value > bound:
            continue
        d, place = automata.owner[g], automata.place[g]
        hold = automata.hold[d]
        if not value < -bound or automata.is_unilateral[d]:
            return -1
        if automata.is_corner[d] and automata.target[d, trial[d], place, 0] >= 0:
            trial[d] = automata.target[d, trial[d], place, 0]
        elif hold >= 0 and place == 0 and trial[d] != hold:
            trial[d] = SURFACE_MODES - hold - trial[d]  # the numbers are 0, 1 and 2
        else:
            return -1
        row = -1
    return row if row >= 0 else row_of(tapes, trial, work)


@inlined
def _is_clear_after(tapes: Any, lin: Any, k: int, fired: int, work: Any) -> bool:
    """Return whether, after the impact, the gap certainly opens and no other guard can be zero."""
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        g = tapes.active[i]
        if work.all_orders[0, g] != (1 if g == fired else 0):
            return False
    rate, curve = _coefficient(lin, k, fired, 1, work)[0], _coefficient(lin, k, fired, 2, work)[0]
    bound = _coefficient(lin, k, fired, 0, work)[1]
    # `hybridsim.engine.events.zeno.hidden_bounces` finds the end of bounces that rounding may hide
    return curve >= 0.0 or -4.0 * curve * bound < _MARGIN * LEAST_LOSS * rate * rate


def resolve_impact(
    automata: Any, tapes: Any, inputs: Any, lin: Any, state: Any, work: Any, fired: int
) -> int:
    """Compute the states and the modes after the impact of the component whose gap closes.

    The modes are unchanged, except for the sides of corners, monitors and slipping contacts that the impact turns over.
    Return the row with sides, orders and floors of the guards, or -1 if the general loop has to resolve the impact.
    """
    functions, at, k = called_by(work), located(state, work), find_modes(tapes, state.z)
    c, x, x_error = automata.owner[fired], work.x_after, work.slopes
    if k < 0 or _may_take_part(automata, c, at.z):
        return -1
    put(at.x, x)
    put(at.x_error, x_error)
    measure_point(lin, work)
    guard_series(tapes, inputs, lin, k, at, x, x_error, work)
    rate, bound = _coefficient(lin, k, fired, 1, work)
    if not rate < -bound or not _are_clear(tapes, lin, k, fired, work):
        return -1
    e = _restitution(functions, at, automata.surface[c], -rate, work)
    rebound = -e * rate
    impulse = _impulse(automata, functions, at, c, rate, rebound, work)
    if not (e > 0.0 and abs(impulse) < math.inf):
        return -1
    error = _apply(automata, functions, at, c, impulse, work)
    if e == 1.0 and rebound <= error:
        return -1
    for i in range(x.shape[0]):
        if not abs(x[i]) < math.inf:
            return -1
    measure_point(lin, work)
    guard_series(tapes, inputs, lin, k, at, x, x_error, work)
    row = _set_sides(automata, tapes, lin, k, fired, work)
    if row < 0:
        return -1
    if row != k:
        guard_series(tapes, inputs, lin, row, at, x, x_error, work)
    work.int_slots[ROW] = row
    found = row_verdict(automata, lin, row, work.trial, work.everything, False, 0, work)
    return 0 if found == FINE and _is_clear_after(tapes, lin, row, fired, work) else -1
