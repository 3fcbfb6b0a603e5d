"""Kernels of the fixed-step methods: the classic Runge-Kutta step, the force law by zone, the dichotomy."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.engine.jit import call, kernel

# why a stretch of steps ended
BOUND, FULL, GUARD, MONITOR, NOT_FINITE = 0, 1, 2, 3, 4
# rules that choose the modes of surface components
ZONE, SIGN = 0, 1


@kernel
def choose_modes(
    addresses: Any,
    rule: int,
    eps: float,
    zeroed: bool,
    table: Any,
    s: float,
    x: Any,
    p: Any,
    z: Any,
    surfaces: Any,
    guards: Any,
) -> None:
    """Modes of the surface components from the state, in place.

    ZONE is Eq. 4 of the paper: beyond eps the mode of that side; inside it the holding mode while the unknown stays
    within its limits, else the side that it pushes to. SIGN: the side alone, and the holding mode as a mark of an
    exact zero. table rows: component, above, below, hold, upper guard, lower guard.
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
    if rule == SIGN:
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
def slope(
    addresses: Any, rule: int, table: Any, s: float, x: Any, p: Any, z: Any, out: Any, work: Any
) -> None:
    """dx/dt; under SIGN an exact zero takes the mean of both sides, which is sgn(0) = 0 for a symmetric law."""
    at_zero = False
    if rule == SIGN:
        for k in range(table.shape[0]):
            at_zero = at_zero or z[table[k, 0]] == table[k, 3]
    if not at_zero:
        call(addresses[0], s, x, p, z, out)
        return
    sides = z.copy()
    for k in range(table.shape[0]):
        if z[table[k, 0]] == table[k, 3]:
            sides[table[k, 0]] = table[k, 1]
    call(addresses[0], s, x, p, sides, out)
    for k in range(table.shape[0]):
        if z[table[k, 0]] == table[k, 3]:
            sides[table[k, 0]] = table[k, 2]
    call(addresses[0], s, x, p, sides, work)
    for i in range(out.shape[0]):
        out[i] = 0.5 * (out[i] + work[i])


@kernel
def rk4_step(
    addresses: Any,
    rule: int,
    every_stage: bool,
    eps: float,
    zeroed: bool,
    table: Any,
    s: float,
    h: float,
    x: Any,
    p: Any,
    z: Any,
    out: Any,
    surfaces: Any,
    guards: Any,
) -> None:
    """One classic Runge-Kutta step of length h from (s, x) in z; the modes held over it, or chosen at every stage."""
    n = x.shape[0]
    k = np.empty((4, n))
    work, stage, modes = np.empty(n), np.empty(n), z.copy()
    slope(addresses, rule, table, s, x, p, modes, k[0], work)
    for j in range(1, 4):
        c = 0.5 if j < 3 else 1.0
        for i in range(n):
            stage[i] = x[i] + c * h * k[j - 1, i]
        if every_stage:
            choose_modes(addresses, rule, eps, zeroed, table, s + c * h, stage, p, modes, surfaces, guards)
        slope(addresses, rule, table, s + c * h, stage, p, modes, k[j], work)
    for i in range(n):
        out[i] = x[i] + h / 6.0 * (k[0, i] + 2.0 * k[1, i] + 2.0 * k[2, i] + k[3, i])


@kernel
def _leaves(values: Any, numbers: Any) -> bool:
    """Whether one of the watched guards is negative."""
    for i in range(numbers.shape[0]):
        if numbers[i] >= 0 and values[numbers[i]] < 0.0:
            return True
    return False


@kernel
def _reversed_surface(before: Any, after: Any, table: Any, z: Any) -> int:
    """Row of the first slipping surface component whose sign changed over the step, -1 if none."""
    for k in range(table.shape[0]):
        if z[table[k, 0]] != table[k, 3] and before[k] * after[k] < 0.0:
            return k
    return -1


@kernel
def _released(values: Any, table: Any, z: Any) -> bool:
    """Whether a held component is beyond its limit."""
    for k in range(table.shape[0]):
        if z[table[k, 0]] == table[k, 3] and (values[table[k, 4]] < 0.0 or values[table[k, 5]] < 0.0):
            return True
    return False


@kernel
def run_steps(
    addresses: Any,
    settings: Any,
    flags: Any,
    table: Any,
    watched: Any,
    s: float,
    bound: float,
    p: Any,
    x: Any,
    z: Any,
    monitor_count: int,
    times: Any,
    states: Any,
    modes: Any,
    counters: Any,
) -> tuple[int, int]:
    """Fixed steps from (s, x) towards the bound, until something needs the caller.

    addresses: flow, surfaces, guards, monitors, project. settings: step, eps, halvings, length of a first step (0:
    none). flags: rule, every stage, dichotomy, zeroed, located release, rest of step. counters: rhs, guards, halvings.
    Row k of times, states, modes holds the start of step k and the modes it was taken in; the last row the end.
    Returns (number of rows, why it ended).
    """
    step, eps, halvings, first = settings[0], settings[1], int(settings[2]), settings[3]
    rule, every_stage, dichotomy = flags[0], flags[1] != 0, flags[2] != 0
    zeroed, located, rest = flags[3] != 0, flags[4] != 0, flags[5] != 0
    n, direction = x.shape[0], 1.0 if bound >= s else -1.0
    surfaces, after = np.zeros(max(table.shape[0], 1)), np.zeros(max(table.shape[0], 1))
    guards = np.zeros(max(int(settings[4]), 1))
    monitors, monitors_after = np.zeros(max(monitor_count, 1)), np.zeros(max(monitor_count, 1))
    trial, work = np.empty(n), np.empty(n)
    planned = first if first > 0.0 else step
    row = 0
    while True:
        choose_modes(addresses, rule, eps, zeroed, table, s, x, p, z, surfaces, guards)
        if zeroed:
            call(addresses[4], s, x, p, z, work)
            x[:] = work
        times[row] = s
        states[row] = x
        modes[row] = z
        row += 1
        if s == bound:
            return row, BOUND
        if row >= times.shape[0]:
            return row, FULL
        last = direction * (bound - s) <= planned * (1.0 + 1e-12)
        h = bound - s if last else direction * planned
        planned = step
        call(addresses[1], s, x, p, z, surfaces)
        rk4_step(addresses, rule, every_stage, eps, zeroed, table, s, h, x, p, z, trial, after, guards)
        counters[0] += 4
        for i in range(n):
            if not np.isfinite(trial[i]):
                return row, NOT_FINITE
        call(addresses[2], s + h, trial, p, z, guards)
        counters[1] += 1
        if _leaves(guards, watched):
            return row, GUARD
        if monitor_count > 0:
            call(addresses[3], s, x, p, z, monitors)
            call(addresses[3], s + h, trial, p, z, monitors_after)
            for k in range(monitor_count):
                changed = (monitors[k] > 0.0) != (monitors_after[k] > 0.0)
                if monitors[k] != 0.0 and changed and monitors[k] * monitors_after[k] <= 0.0:
                    return row, MONITOR
        if dichotomy:
            freed = located and _released(guards, table, z)
            call(addresses[1], s + h, trial, p, z, after)
            k = _reversed_surface(surfaces, after, table, z)
            if k >= 0 or freed:
                low, high, sign = 0.0, h, surfaces[max(k, 0)]
                tau = h
                for _ in range(halvings):
                    tau = 0.5 * (low + high)
                    rk4_step(
                        addresses,
                        rule,
                        every_stage,
                        eps,
                        zeroed,
                        table,
                        s,
                        tau,
                        x,
                        p,
                        z,
                        trial,
                        after,
                        guards,
                    )
                    counters[0] += 4
                    counters[2] += 1
                    if k >= 0:
                        call(addresses[1], s + tau, trial, p, z, after)
                        if abs(after[k]) <= eps:
                            break
                        beyond = after[k] * sign < 0.0
                    else:
                        call(addresses[2], s + tau, trial, p, z, guards)
                        beyond = _released(guards, table, z)
                    if beyond:
                        high = tau
                    else:
                        low = tau
                if k < 0:
                    # the end of the bracket where the limit is passed, so that the release is seen
                    tau = high
                    rk4_step(
                        addresses,
                        rule,
                        every_stage,
                        eps,
                        zeroed,
                        table,
                        s,
                        tau,
                        x,
                        p,
                        z,
                        trial,
                        after,
                        guards,
                    )
                    counters[0] += 4
                if rest and abs(h) > abs(tau):
                    planned = abs(h - tau)
                    if planned < 1e-9 * step:
                        planned = step
                h, last = tau, False
        s = bound if last else s + h
        x[:] = trial
