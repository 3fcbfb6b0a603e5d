"""What is ahead of Taylor series, at a distance d: the state there, its rates, and whether the series still hold.

It is one array: the powers d**k, k = 0..order; of n states their values there, their rates, the slopes of their series,
and sum_k |c_k| d**(k - 1); of the watched functions their values there, and those of their series.
"""

from __future__ import annotations

from typing import Any

from hybridsim.engine.jets import UNIT
from hybridsim.engine.jit import call_apart, call_series, inlined, kernel
from hybridsim.engine.taylor import advance, tabulate

_DEFECT = 100.0  # as in the taylor integrator
# Shares of a step, by the golden ratio: where a state that seems to go straight on is looked at before the end.
BETWEEN = (0.618, 0.236, 0.854, 0.472, 0.09, 0.708, 0.326, 0.944)


def room_ahead(order: int, n: int, guards: int) -> int:
    """How many numbers these are."""
    return order + 1 + 4 * n + 2 * guards


@inlined
def parts_of(ahead: Any, order: int, n: int, count: int) -> tuple[Any, Any, Any, Any]:
    """Of the array: states, their rates, values of the functions, values of their series."""
    x, f = order + 1, order + 1 + 4 * n
    return ahead[x : x + n], ahead[x + n : x + 2 * n], ahead[f : f + count], ahead[f + count : f + 2 * count]


@inlined
def sum_at(U: Any, r: int, order: int, powers: Any) -> float:
    """Value of the series in a row of U, for the powers of a distance, order >= 1; even and odd terms side by side."""
    even, odd = U[r, 0], U[r, 1] * powers[1]
    for k in range(2, order, 2):
        even += U[r, k] * powers[k]
        odd += U[r, k + 1] * powers[k + 1]
    if order % 2 == 0:
        even += U[r, order] * powers[order]
    return even + odd


@inlined
def values_at(
    code: int, rows: Any, places: Any, s: float, x: Any, watched: Any, W: Any, values: Any, rates: Any
) -> None:
    """Rates of the states and values of the watched functions at (s, x), by code at an address, if there is some."""
    if code != 0:
        call_series(code, s, 0.0, x, values, W, rates)
    else:
        call_apart(_interpreted_values, (rows, places, s, x, watched, W, values, rates))


@kernel
def _interpreted_values(
    rows: Any, places: Any, s: float, x: Any, watched: Any, W: Any, values: Any, rates: Any
) -> None:
    """As `values_at`, by the interpreter of tapes."""
    time, states, derivatives = places
    if time >= 0:
        W[time, 0] = s
    for i in range(states.shape[0]):
        W[states[i], 0] = x[i]
    call_apart(advance, (rows, W, 0))
    for i in range(states.shape[0]):
        rates[i] = W[derivatives[i], 0]
    for j in range(watched.shape[0]):
        values[j] = W[watched[j], 0]


@inlined
def look_ahead(
    code: int,
    rows: Any,
    places: Any,
    order: int,
    s: float,
    d: float,
    watched: Any,
    series: Any,
    U: Any,
    W: Any,
    ahead: Any,
) -> None:
    """Fill the array for series (n, order + 1) of states and U of the watched functions from local time s.

    code: address of a function that does the same; 0 for none. W: the tape with its constants.
    """
    if code != 0:
        call_series(code, s, d, series, U, W, ahead)
        return
    n, count = series.shape[0], watched.shape[0]
    tabulate(d, order, ahead)
    x, rates, values, sums = parts_of(ahead, order, n, count)
    for i in range(n):
        # each sum in two lines, which do not wait for each other; what is least comes first
        change = series[i, order] * ahead[order]
        other = series[i, order - 1] * ahead[order - 1]
        for k in range(order - 2, 0, -2):
            change += series[i, k] * ahead[k]
            if k > 1:
                other += series[i, k - 1] * ahead[k - 1]
        x[i] = series[i, 0] + (change + other)
        term = series[i, 2] * ahead[1]
        slope, other_slope = series[i, 1], 2.0 * term
        change, other = abs(series[i, 1]), abs(term)
        for k in range(3, order + 1, 2):
            term = series[i, k] * ahead[k - 1]
            slope += k * term
            change += abs(term)
            if k < order:
                term = series[i, k + 1] * ahead[k]
                other_slope += (k + 1) * term
                other += abs(term)
        ahead[order + 1 + 2 * n + i] = slope + other_slope
        ahead[order + 1 + 3 * n + i] = change + other
    for j in range(count):
        sums[j] = sum_at(U, j, order, ahead)
    call_apart(_interpreted_values, (rows, places, s + d, x, watched, W, values, rates))


@inlined
def flow_holds(ahead: Any, order: int, n: int, d: float, x0: Any, rtol: float, atol: Any) -> bool:
    """Whether the series of states from x0 still meet their equation."""
    x = order + 1
    for i in range(x, x + n):
        rate, slope, change = ahead[i + n], ahead[i + 2 * n], ahead[i + 3 * n]
        scale = atol[i - x] + rtol * (max(abs(x0[i - x]), abs(ahead[i])) + change * d)
        if not abs(d * (slope - rate)) <= _DEFECT * scale:
            return False
    return True


@inlined
def seems_straight(computed: Any, series: Any, order: int, powers: Any, rtol: float, atol: Any) -> bool:
    """Whether by its series the rate of a state hardly changes, which may be different later.

    computed (n,): see `hybridsim.engine.mode_tables`. Of a rate such as 1 + sin(t)**20 all terms but the first vanish
    where it begins: they tell nothing of the step, at whose end they may vanish again.
    """
    for i in range(series.shape[0]):
        scale, k = atol[i] + rtol * abs(series[i, 0]), 2
        while computed[i] and k <= order and abs(series[i, k]) * powers[k] <= scale:
            k += 1
        if k > order:
            return True
    return False


@kernel
def keeps_up(U: Any, watched: Any, order: int, powers: Any, rtol: float, values: Any, sums: Any) -> bool:
    """Whether the series of functions, in the watched rows of U, still give their values, by their sums."""
    share = _DEFECT * rtol + 64.0 * UNIT
    for j in range(watched.shape[0]):
        r = watched[j]
        off, largest = abs(sums[j] - values[j]), abs(U[r, 0])
        if off <= share * largest:
            continue
        for k in range(1, order + 1):
            largest = max(largest, abs(U[r, k]) * powers[k])
        if not off <= share * largest:
            return False
    return True
