"""Kernels of the published methods: the classic Runge-Kutta step, the force law by zone, the bisection."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import call, inlined, kernel
from hybridsim.integrators.fixed_step.kernels import BOUND, CONTINUES, FULL, RESTED, brought_to_zero, passed

# rules that choose the modes of surface components
ZONE, SIGN = 0, 1


@inlined
def _any_held(table: Any, z: Any) -> bool:
    """Return whether a surface component is in its holding mode."""
    for k in range(table.shape[0]):
        if z[table[k, 0]] == table[k, 3]:
            return True
    return False


@inlined
def choose_modes(
    addresses: Any,
    rule: int,
    eps: float,
    table: Any,
    s: float,
    x: Any,
    p: Any,
    z: Any,
    surfaces: Any,
    guards: Any,
) -> None:
    """Set the modes of the surface components from the state, in place.

    ZONE is Eq. 4 of the paper: outside eps the mode of that side; inside it the holding mode while the
    unknown stays within its limits, else the side to which it pushes. SIGN: the side alone, and the holding
    mode to mark an exact zero. table rows: component, above, below, hold, upper guard, lower guard.
    """
    call(addresses[1], s, x, p, z, surfaces)
    for k in range(table.shape[0]):
        c, value = table[k, 0], surfaces[k]
        if value >= eps and value > 0.0:
            z[c] = table[k, 1]
        elif value <= -eps and value < 0.0:
            z[c] = table[k, 2]
        else:
            z[c] = table[k, 3]
    if rule == SIGN or not _any_held(table, z):
        return
    for _ in range(table.shape[0] + 1):
        call(addresses[2], s, x, p, z, guards)
        changed = False
        for k in range(table.shape[0]):
            if z[table[k, 0]] == table[k, 3]:
                if guards[table[k, 4]] < 0.0:
                    z[table[k, 0]] = table[k, 1]
                    changed = True
                elif guards[table[k, 5]] < 0.0:
                    z[table[k, 0]] = table[k, 2]
                    changed = True
        if not changed:
            break


@kernel
def _mean_of_sides(
    flow: Any, table: Any, s: float, x: Any, p: Any, z: Any, sides: Any, out: Any, other: Any
) -> None:
    """Compute dx/dt at exactly zero velocity as the mean of both sides, i.e. sgn(0) = 0 for a symmetric law."""
    for i in range(z.shape[0]):
        sides[i] = z[i]
    for k in range(table.shape[0]):
        if z[table[k, 0]] == table[k, 3]:
            sides[table[k, 0]] = table[k, 1]
    call(flow, s, x, p, sides, out)
    for k in range(table.shape[0]):
        if z[table[k, 0]] == table[k, 3]:
            sides[table[k, 0]] = table[k, 2]
    call(flow, s, x, p, sides, other)
    for i in range(out.shape[0]):
        out[i] = 0.5 * (out[i] + other[i])


@inlined
def _slope(
    flow: Any, rule: int, table: Any, s: float, x: Any, p: Any, z: Any, sides: Any, out: Any, other: Any
) -> None:
    """Compute dx/dt in the modes z."""
    if rule == SIGN and _any_held(table, z):
        _mean_of_sides(flow, table, s, x, p, z, sides, out, other)
    else:
        call(flow, s, x, p, z, out)


@inlined
def _step(
    addresses: Any, law: Any, table: Any, s: float, h: float, x: Any, p: Any, z: Any, out: Any, work: Any
) -> None:
    """Compute one classic Runge-Kutta step, inlined into its callers; see `rk4_step`."""
    rule, every_stage, eps = law
    k, stage, other, modes, sides, surfaces, guards = work[:7]
    n = x.shape[0]
    for i in range(z.shape[0]):
        modes[i] = z[i]
    _slope(addresses[0], rule, table, s, x, p, modes, sides, k[0], other)
    for j in range(1, 4):
        c = 0.5 if j < 3 else 1.0
        for i in range(n):
            stage[i] = x[i] + c * h * k[j - 1, i]
        if every_stage:
            choose_modes(addresses, rule, eps, table, s + c * h, stage, p, modes, surfaces, guards)
        _slope(addresses[0], rule, table, s + c * h, stage, p, modes, sides, k[j], other)
    for i in range(n):
        out[i] = x[i] + h / 6.0 * (k[0, i] + 2.0 * k[1, i] + 2.0 * k[2, i] + k[3, i])


@kernel
def rk4_step(
    addresses: Any, law: Any, table: Any, s: float, h: float, x: Any, p: Any, z: Any, out: Any, work: Any
) -> None:
    """Take one classic Runge-Kutta step of length h from (s, x) in z, with modes fixed or chosen at every stage.

    law: rule, every stage, eps. work: see `workspace`.
    """
    _step(addresses, law, table, s, h, x, p, z, out, work)


def workspace(n: int, components: int, surfaces: int, guards: int, monitors: int) -> tuple[np.ndarray, ...]:
    """Allocate the arrays of the kernels.

    For a step: slopes (4, n), a stage, another slope, modes, modes of one side, surface values, guard values.
    For the march: surface values at both ends of a step, guard values, monitor values at both ends, a trial
    state, a held one.
    """
    surfaces, guards, monitors = max(surfaces, 1), max(guards, 1), max(monitors, 1)
    modes = (np.empty(components, dtype=np.int64), np.empty(components, dtype=np.int64))
    of_step = (np.empty((4, n)), np.empty(n), np.empty(n), *modes, np.empty(surfaces), np.empty(guards))
    sizes = (surfaces, surfaces, guards, monitors, monitors, n, n)
    return (*of_step, *(np.zeros(size) for size in sizes))


@inlined
def _reversed_surface(before: Any, after: Any, table: Any, z: Any) -> int:
    """Return the row of the first slipping surface component whose sign changed over the step, or -1."""
    for k in range(table.shape[0]):
        if z[table[k, 0]] != table[k, 3] and before[k] * after[k] < 0.0:
            return k
    return -1


@inlined
def _released(values: Any, table: Any, z: Any) -> bool:
    """Return whether a held component is beyond its limit."""
    for k in range(table.shape[0]):
        if z[table[k, 0]] == table[k, 3] and (values[table[k, 4]] < 0.0 or values[table[k, 5]] < 0.0):
            return True
    return False


@kernel
def _halve_step(
    addresses: Any,
    law: Any,
    halvings: int,
    table: Any,
    s: float,
    h: float,
    x: Any,
    p: Any,
    z: Any,
    row: int,
    sign: float,
    out: Any,
    after: Any,
    guards: Any,
    work: Any,
    counters: Any,
) -> float:
    """Bisect a step of length h until surface `row` is within eps or, for row < 0, until a limit is passed.

    Write the state to `out` and return the length of the step to it.
    """
    low, high, tau = 0.0, h, h
    for _ in range(halvings):
        tau = 0.5 * (low + high)
        rk4_step(addresses, law, table, s, tau, x, p, z, out, work)
        counters[0] += 4
        counters[2] += 1
        if row >= 0:
            call(addresses[1], s + tau, out, p, z, after)
            if abs(after[row]) <= law[2]:
                return tau
            beyond = after[row] * sign < 0.0
        else:
            call(addresses[2], s + tau, out, p, z, guards)
            beyond = _released(guards, table, z)
        if beyond:
            high = tau
        else:
            low = tau
    if row >= 0:
        return tau
    # the end of the bracket beyond the limit, so that the release is detected
    rk4_step(addresses, law, table, s, high, x, p, z, out, work)
    counters[0] += 4
    return high


@kernel
def run_steps(
    addresses: Any,
    settings: Any,
    law: Any,
    flags: Any,
    table: Any,
    guard_numbers: Any,
    bound: float,
    p: Any,
    x: Any,
    z: Any,
    fresh: Any,
    times: Any,
    states: Any,
    modes: Any,
    work: Any,
    counters: Any,
) -> tuple[int, int]:
    """Take fixed steps from local time 0 in (x, z) towards the bound, until Python has to act.

    addresses: flow, surfaces, guards, monitors, project. settings: step, halvings. law, work: as for
    `rk4_step`. flags: bisection, zeroed, located release, rest of step. counters: rhs, guards, halvings.
    fresh: monitors that have just fired, whose remaining zero on the first step is not a new one. Row k of
    times, states, modes holds the start of step k and the modes during it; the last row is the end. Return
    (number of rows, reason).
    """
    step, halvings = settings
    rule, _, eps = law
    dichotomy, zeroed, located, rest = flags
    n, s, direction = x.shape[0], 0.0, 1.0 if bound >= 0.0 else -1.0
    surfaces, after, guards, monitors, monitors_after, trial, held = work[7:]
    planned, row = step, 0
    while True:
        choose_modes(addresses, rule, eps, table, s, x, p, z, surfaces, guards)
        if zeroed and _any_held(table, z):
            call(addresses[4], s, x, p, z, held)
            for i in range(n):
                x[i] = held[i]
            call(addresses[1], s, x, p, z, surfaces)
        times[row] = s
        for i in range(n):
            states[row, i] = x[i]
        for i in range(z.shape[0]):
            modes[row, i] = z[i]
        row += 1
        if brought_to_zero(addresses[3], s, x, p, z, fresh, row == 1, monitors, monitors_after):
            return row, RESTED
        if s == bound:
            return row, BOUND
        if row >= times.shape[0]:
            return row, FULL
        last = direction * (bound - s) <= planned * (1.0 + 1e-12)
        h = bound - s if last else direction * planned
        planned = step
        _step(addresses, law, table, s, h, x, p, z, trial, work)
        counters[0] += 4
        why = passed(
            (addresses[2], addresses[3]), s + h, trial, p, z, guard_numbers, fresh, row == 1, guards, monitors,
            monitors_after, counters,
        )  # fmt: skip
        if why != CONTINUES:
            return row, why
        if dichotomy:
            freed = False
            if located and _any_held(table, z):
                call(addresses[2], s + h, trial, p, z, guards)
                counters[1] += 1
                freed = _released(guards, table, z)
            call(addresses[1], s + h, trial, p, z, after)
            k = _reversed_surface(surfaces, after, table, z)
            if k >= 0 or freed:
                tau = _halve_step(
                    addresses,
                    law,
                    halvings,
                    table,
                    s,
                    h,
                    x,
                    p,
                    z,
                    k,
                    surfaces[max(k, 0)],
                    trial,
                    after,
                    guards,
                    work,
                    counters,
                )
                if rest and abs(h - tau) > 1e-9 * step:
                    planned = abs(h - tau)
                h, last = tau, False
        s = bound if last else s + h
        for i in range(n):
            x[i] = trial[i]
