"""This module contains the kernels of the published methods: RK4 step, force law, and bisection."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import call, inlined, kernel
from hybridsim.engine.system.system import System
from hybridsim.integrators.fixed_step.kernels import BOUND, CONTINUES, FULL, RESTED, brought_to_zero, passed


@inlined
def _any_held(table: Any, z: Any) -> bool:
    """Return whether any contact or switching surface is in its holding mode."""
    for k in range(table.shape[0]):
        if z[table[k, 0]] == table[k, 3]:
            return True
    return False


def workspace(system: System, surfaces: int, rows: int) -> tuple[np.ndarray, ...]:
    """Allocate the scratch arrays of the kernels.

    Surface values and eps; results of a step (see `step_code`); guard values; monitor values at both ends of a step.
    """
    monitors = len(system.monitor_names)
    sizes = (surfaces + 3 + rows, system.n + surfaces + 2, system.guard_count, monitors, monitors)
    return tuple(np.zeros(max(size, 1)) for size in sizes)


@inlined
def _reversed_surface(before: Any, after: Any, table: Any, z: Any) -> int:
    """Return the row of the first slipping contact whose velocity changed sign in the step, or -1."""
    for k in range(table.shape[0]):
        if z[table[k, 0]] != table[k, 3] and before[k] * after[k] < 0.0:
            return k
    return -1


@inlined
def _released(values: Any, table: Any, z: Any) -> bool:
    """Return whether a sticking contact is beyond its stick limit."""
    for k in range(table.shape[0]):
        if z[table[k, 0]] == table[k, 3] and (values[table[k, 4]] < 0.0 or values[table[k, 5]] < 0.0):
            return True
    return False


@kernel
def _halve_step(
    addresses: Any,
    halvings: int,
    eps: float,
    table: Any,
    s: float,
    h: float,
    x: Any,
    p: Any,
    z: Any,
    row: int,
    sign: float,
    out: Any,
    guards: Any,
    counters: Any,
) -> float:
    """Bisect a step until surface `row` is zero within `eps`; for row < 0, until a stick limit is exceeded.

    Write the results of the last step to `out` and return its length.
    """
    n, length = x.shape[0], out.shape[0] - 2
    low, high, tau = 0.0, h, h
    for _ in range(halvings):
        out[length] = tau = 0.5 * (low + high)
        call(addresses[1], s, x, p, z, out)
        counters[0] += 4
        counters[2] += 1
        if row >= 0:
            if abs(out[n + row]) <= eps:
                return tau
            beyond = out[n + row] * sign < 0.0
        else:
            call(addresses[3], s + tau, out, p, z, guards)
            beyond = _released(guards, table, z)
        if beyond:
            high = tau
        else:
            low = tau
    if row >= 0:
        return tau
    # the end of the bracket beyond the limit, so that the release is detected
    out[length] = high
    call(addresses[1], s, x, p, z, out)
    counters[0] += 4
    return high


@kernel
def run_steps(
    addresses: Any,
    settings: Any,
    flags: Any,
    table: Any,
    guard_numbers: Any,
    bound: float,
    p: Any,
    z: Any,
    fresh: Any,
    times: Any,
    states: Any,
    modes: Any,
    work: Any,
    counters: Any,
) -> tuple[int, int]:
    """Take fixed steps from local time 0 towards the bound, until an event needs the Python code.

    addresses: choose, step, march (see `step_code`), guards, monitors, project, surfaces. settings: step, halvings,
    eps. flags: bisection, zeroed, located release, rest of step, whether march can be used. counters: rhs, guards,
    halvings. fresh: monitors that have just fired, whose remaining zero on the first step is not a new one. Row k of
    times, states, modes holds the start of step k and the modes during it; the last row is the end. Return (number of
    rows, reason).
    """
    step, halvings, eps = settings
    dichotomy, zeroed, located, rest, has_march = flags
    n, s = states.shape[1], 0.0
    surfaces, trial, guards, monitors, monitors_after = work
    length = trial.shape[0] - 2
    end, after = trial[:n], trial[n:]
    count = length - n
    surfaces[count] = trial[length + 1] = eps
    surfaces[count + 1] = step
    flat_states, flat_modes = states.reshape(states.size), modes.reshape(modes.size)
    marches = has_march and guard_numbers.shape[0] == 0
    planned, row = step, 0
    while True:
        x = states[row]
        call(addresses[0], s, x, p, z, surfaces)
        if zeroed and _any_held(table, z):
            call(addresses[5], s, x, p, z, trial)
            for i in range(n):
                x[i] = trial[i]
            call(addresses[6], s, x, p, z, surfaces)
        times[row] = s
        for i in range(z.shape[0]):
            modes[row, i] = z[i]
        row += 1
        if brought_to_zero(addresses[4], s, x, p, z, fresh, row == 1, monitors, monitors_after):
            return row, RESTED
        if s == bound:
            return row, BOUND
        if row >= times.shape[0]:
            return row, FULL
        steps = min(np.floor((bound - s) / step) - 2.0, times.shape[0] - row - 1.0)
        if marches and planned == step and steps >= 1.0:
            surfaces[count + 2] = steps
            first, first_modes = flat_states[n * (row - 1) :], flat_modes[z.shape[0] * (row - 1) :]
            call(addresses[2], s, first, p, first_modes, surfaces)
            for k in range(int(surfaces[count + 2])):
                times[row] = surfaces[count + 3 + k]
                row += 1
                counters[0] += 4
            s, x = times[row - 1], states[row - 1]
            for i in range(z.shape[0]):
                z[i] = modes[row - 1, i]
        last = bound - s <= planned * (1.0 + 1e-12)
        h = bound - s if last else planned
        planned = step
        trial[length] = h
        call(addresses[1], s, x, p, z, trial)
        counters[0] += 4
        why = passed(
            (addresses[3], addresses[4]), s + h, end, p, z, guard_numbers, fresh, row == 1, guards, monitors,
            monitors_after, counters,
        )  # fmt: skip
        if why != CONTINUES:
            return row, why
        if dichotomy:
            freed = False
            if located and _any_held(table, z):
                call(addresses[3], s + h, trial, p, z, guards)
                counters[1] += 1
                freed = _released(guards, table, z)
            k = _reversed_surface(surfaces, after, table, z)
            if k >= 0 or freed:
                tau = _halve_step(
                    addresses, halvings, eps, table, s, h, x, p, z, k, surfaces[max(k, 0)], trial, guards, counters
                )  # fmt: skip
                if rest and abs(h - tau) > 1e-9 * step:
                    planned = abs(h - tau)
                h, last = tau, False
        s = bound if last else s + h
        for i in range(n):
            states[row, i] = end[i]
