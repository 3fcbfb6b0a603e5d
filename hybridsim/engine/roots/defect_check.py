"""This module evaluates the end of a Taylor step, and checks the accuracy of the series at this end.

The results are in one array: the powers d**k, k = 0..order; for n states their values, their rates, the
slopes of their series times d, and sum_k |c_k| d**k, k > 0; for the guards their values and those
of their series.
"""

from __future__ import annotations

from typing import Any

from hybridsim.engine.native.kernels import call_noinline, call_series, fused, inlined, kernel
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.series.interpreter import advance, tabulate

_DEFECT = 100.0  # as in the taylor integrator
# Shares of a step, by the golden ratio: test points for a state that seems to follow a straight line.
BETWEEN = (0.618, 0.236, 0.854, 0.472, 0.09, 0.708, 0.326, 0.944)


def ahead_size(order: int, n: int, guards: int) -> int:
    """Return the length of the array that `look_ahead` fills."""
    return order + 1 + 4 * n + 2 * guards


@inlined
def parts_of(ahead: Any, order: int, n: int, count: int) -> tuple[Any, Any, Any, Any]:
    """Split the array of `look_ahead` into states, rates, function values and sums of series."""
    x, f = order + 1, order + 1 + 4 * n
    return ahead[x : x + n], ahead[x + n : x + 2 * n], ahead[f : f + count], ahead[f + count : f + 2 * count]


@inlined
def sum_at(U: Any, r: int, order: int, powers: Any) -> float:
    """Evaluate the Taylor series in one row of `U` from the powers of a distance.

    The order of summation is that of `sum_sizes` in `hybridsim.engine.series.interpreter`.
    """
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    for k in range(order - 3, 0, -4):
        a, b = fused(U[r, k], powers[k], a), fused(U[r, k + 1], powers[k + 1], b)
        c, d = fused(U[r, k + 2], powers[k + 2], c), fused(U[r, k + 3], powers[k + 3], d)
    total = (a + c) + (b + d)
    for k in range(order % 4, 0, -1):
        total = fused(U[r, k], powers[k], total)
    return U[r, 0] + total


@inlined
def values_at(
    code: int,
    rows: Any,
    flow_registers: Any,
    s: float,
    x: Any,
    guard_registers: Any,
    W: Any,
    values: Any,
    rates: Any,
) -> None:
    """Compute rates of the states and values of the guards, by compiled code if available."""
    if code != 0:
        call_series(code, s, 0.0, x, values, W, rates)
    else:
        call_noinline(_interpreted_values, (rows, flow_registers, s, x, guard_registers, W, values, rates))


@kernel
def _interpreted_values(
    rows: Any, flow_registers: Any, s: float, x: Any, guard_registers: Any, W: Any, values: Any, rates: Any
) -> None:
    """Compute rates of the states and values of the guards with the interpreter of instruction tapes."""
    time, states, derivatives = flow_registers
    if time >= 0:
        W[time, 0] = s
    for i in range(states.shape[0]):
        W[states[i], 0] = x[i]
    call_noinline(advance, (rows, W, 0))
    for i in range(states.shape[0]):
        rates[i] = W[derivatives[i], 0]
    for j in range(guard_registers.shape[0]):
        values[j] = W[guard_registers[j], 0]


@inlined
def _together(four: tuple[float, float, float, float]) -> float:
    """Return the sum of four numbers, added in the order of vector instructions."""
    return (four[0] + four[2]) + (four[1] + four[3])


@inlined
def look_ahead(
    code: int, rows: Any, flow_registers: Any, order: int, s: float, d: float, guard_registers: Any, series: Any,
    U: Any, W: Any, ahead: Any,
) -> None:  # fmt: skip
    """Evaluate Taylor series of states and guards at a distance from their origin, to check their accuracy.

    code: address of a function that does the same; 0 for none. W: the registers of the tape with its
    constants.
    """
    if code != 0:
        call_series(code, s, d, series, U, W, ahead)
    else:
        tape = (rows, flow_registers, guard_registers)
        call_noinline(_interpreted_ahead, (tape, order, s, d, series, U, W, ahead))


@kernel
def _interpreted_ahead(
    tape: Any, order: int, s: float, d: float, series: Any, U: Any, W: Any, ahead: Any
) -> None:
    """Fill the array of `look_ahead` with the interpreter of instruction tapes."""
    rows, flow_registers, guard_registers = tape
    n, count = series.shape[0], guard_registers.shape[0]
    tabulate(d, order, ahead)
    x, rates, values, sums = parts_of(ahead, order, n, count)
    for i in range(n):
        values_of_four, slopes, sizes = (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)
        for k in range(order - 3, 0, -4):  # four interleaved sums, from the last terms on
            one, two = series[i, k] * ahead[k], series[i, k + 1] * ahead[k + 1]
            three, four = series[i, k + 2] * ahead[k + 2], series[i, k + 3] * ahead[k + 3]
            a, b, c, e = values_of_four
            values_of_four = a + one, b + two, c + three, e + four
            a, b, c, e = slopes
            slopes = (
                fused(float(k), one, a), fused(k + 1.0, two, b), fused(k + 2.0, three, c), fused(k + 3.0, four, e)
            )  # fmt: skip
            a, b, c, e = sizes
            sizes = a + abs(one), b + abs(two), c + abs(three), e + abs(four)
        value, slope, size = _together(values_of_four), _together(slopes), _together(sizes)
        for k in range(order % 4, 0, -1):
            term = series[i, k] * ahead[k]
            value, slope, size = value + term, fused(float(k), term, slope), size + abs(term)
        x[i] = series[i, 0] + value
        ahead[order + 1 + 2 * n + i] = slope
        ahead[order + 1 + 3 * n + i] = size
    for j in range(count):
        sums[j] = sum_at(U, j, order, ahead)
    call_noinline(_interpreted_values, (rows, flow_registers, s + d, x, guard_registers, W, values, rates))


@inlined
def flow_holds(ahead: Any, order: int, n: int, d: float, x0: Any, rtol: float, atol: Any) -> bool:
    """Return whether the Taylor series of the states still satisfy the differential equation."""
    x = order + 1
    for i in range(x, x + n):
        rate, slope, change = ahead[i + n], ahead[i + 2 * n], ahead[i + 3 * n]
        scale = atol[i - x] + rtol * (max(abs(x0[i - x]), abs(ahead[i])) + change)
        if not abs(slope - d * rate) <= _DEFECT * scale:
            return False
    return True


@inlined
def seems_straight(computed: Any, series: Any, order: int, powers: Any, rtol: float, atol: Any) -> bool:
    """Return whether the rate of a state is almost constant in its Taylor series.

    computed (n,): see `hybridsim.engine.system.programs.mode_tables`. For a rate such as 1 + sin(t)**20 all
    terms but the first vanish at the start. They do not limit the step, at whose end they may vanish again.
    """
    for i in range(series.shape[0]):
        scale, k = atol[i] + rtol * abs(series[i, 0]), 2
        while computed[i] and k <= order and abs(series[i, k]) * powers[k] <= scale:
            k += 1
        if k > order:
            return True
    return False


@kernel
def keeps_up(U: Any, monitored: Any, order: int, powers: Any, rtol: float, values: Any, sums: Any) -> bool:
    """Return whether the Taylor series of the guards still agree with the values of the guards."""
    share = _DEFECT * rtol + 64.0 * UNIT
    for j in range(monitored.shape[0]):
        r = monitored[j]
        off, largest = abs(sums[j] - values[j]), abs(U[r, 0])
        if off <= share * largest:
            continue
        for k in range(1, order + 1):
            largest = max(largest, abs(U[r, k]) * powers[k])
        if not off <= share * largest:
            return False
    return True
