"""Compute Taylor coefficients of guards in linear modes, with error bounds, up to the order that is needed.

The point is y = (x_after, w): the states after an event, and the functions of time.
"""

from __future__ import annotations

from typing import Any

from hybridsim.engine.native.kernels import call_noinline, inlined, kernel
from hybridsim.engine.native.loop_hints import short_loop
from hybridsim.engine.native.simd.products import LANES, dot
from hybridsim.engine.series.bounded import ORDER, UNIT

# A row's rounding is at least ten units of its absolute values: the effect of errors of y, relative to that.
_IN_UNITS = 0.125 / UNIT


@inlined
def linear_coefficient(
    lin: Any, k: int, g: int, order: int, x: Any, x_error: Any, work: Any
) -> tuple[float, float]:
    """Return a Taylor coefficient of a guard in the modes of row `k`, with its error bound."""
    if lin.is_polynomial[k, g] != 0:
        return call_noinline(polynomial_coefficient, (lin, k, g, order, x, x_error, work))
    return _row_coefficient(lin, k, g, order, x, x_error, work)


@kernel
def polynomial_coefficient(
    lin: Any, k: int, g: int, order: int, x: Any, x_error: Any, work: Any
) -> tuple[float, float]:
    """Return a Taylor coefficient of a guard with products of states, with its error bound."""
    value, bound = _row_coefficient(lin, k, g, order, x, x_error, work)
    series, errors = work.product[0], work.product[1]
    for q in range(lin.products.shape[0]):
        if lin.shares[k, g, q] == 0.0:
            continue
        for m in range(order + 1):
            series[m] = errors[m] = 0.0
        series[0] = lin.shares[k, g, q]
        for i in range(lin.products.shape[1]):
            f = lin.products[q, i]
            if f < 0:
                break
            for m in range(order, -1, -1):  # each coefficient needs the earlier ones as they were
                total = error = 0.0
                for j in range(m + 1):
                    v, e = _row_coefficient(lin, k, f, j, x, x_error, work)
                    term = abs(series[m - j] * v)
                    total += series[m - j] * v
                    error += errors[m - j] * (abs(v) + e) + abs(series[m - j]) * e + (m + 2) * UNIT * term
                series[m], errors[m] = total, error
        value += series[order]
        bound += errors[order] + UNIT * (abs(value) + abs(series[order]))
    return value, bound


@inlined
def _row_coefficient(
    lin: Any, k: int, g: int, order: int, x: Any, x_error: Any, work: Any
) -> tuple[float, float]:
    """Return a Taylor coefficient of the linear part of a guard, with its error bound."""
    w, w_error, sizes, w_sizes, bound = work.w, work.w_error, work.sizes, work.w_sizes, 0.0
    for m in range(x.shape[0]):
        short_loop()
        sizes[m] = abs(x[m]) + x_error[m]
        bound += abs(lin.series[k, g, order, m]) * x_error[m]
    n = lin.series.shape[3] - w.shape[0]
    n -= n % LANES
    for m in range(w.shape[0]):
        short_loop()
        w_sizes[m] = abs(w[m]) + w_error[m]
        bound += abs(lin.series[k, g, order, n + m]) * w_error[m]
    value = dot(lin.series, (k, g, order), (x, w))
    return value, bound + dot(lin.roundings, (k, g, order), (sizes, w_sizes))


@inlined
def guard_coefficient(lin: Any, k: int, g: int, order: int, y: Any, work: Any) -> float:
    """Return a Taylor coefficient of a guard at the states y."""
    if lin.is_polynomial[k, g] != 0:
        return call_noinline(polynomial_coefficient, (lin, k, g, order, y, work.y_error, work))[0]
    return dot(lin.series, (k, g, order), (y, work.w))


@inlined
def has_tables(lin: Any) -> bool:
    """Return whether the compiled loop has tables of linear modes."""
    return lin.counts.shape[0] > 0


@inlined
def measure_point(lin: Any, work: Any) -> None:
    """Store bounds of the states and of the functions of time, from which rounding errors are estimated."""
    if not has_tables(lin):
        return
    size = 0.0
    x, x_error, w, w_error = work.x_after, work.slopes, work.w, work.w_error
    for m in range(x.shape[0]):
        short_loop()
        size += abs(x[m]) + _IN_UNITS * x_error[m]
    for m in range(w.shape[0]):
        short_loop()
        size += abs(w[m]) + _IN_UNITS * w_error[m]
    work.size[0] = size


@inlined
def rough_coefficient(lin: Any, k: int, g: int, order: int, work: Any) -> tuple[float, float]:
    """Return a Taylor coefficient of a guard, and an error bound, which is wide and fast to compute if possible."""
    if lin.is_polynomial[k, g] != 0:
        return call_noinline(polynomial_coefficient, (lin, k, g, order, work.x_after, work.slopes, work))
    return dot(lin.series, (k, g, order), (work.x_after, work.w)), lin.largest[k, g, order] * work.size[0]


@inlined
def rough_side(lin: Any, k: int, g: int, order: int, work: Any) -> int:
    """Return the sign of a Taylor coefficient of a guard, or 0 if the sign is uncertain."""
    value, bound = rough_coefficient(lin, k, g, order, work)
    if not abs(value) > bound:
        return 0
    return 1 if value > 0.0 else -1


@inlined
def linear_series(lin: Any, k: int, g: int, first: int, work: Any) -> None:
    """Write the Taylor coefficients of a guard to `judged`, up to the first one that exceeds its error bound.

    Nothing is written if there are no tables of linear modes. k: row of the modes. The point is y = (x_after, w); see
    `measure_point`.
    """
    if has_tables(lin):
        value, bound = rough_coefficient(lin, k, g, first, work)
        work.judged[0, g, first], work.judged[1, g, first] = value, bound
        if not abs(value) > bound:
            call_noinline(_exact_series, (lin, k, g, first, work))


@kernel
def _exact_series(lin: Any, k: int, g: int, first: int, work: Any) -> None:
    value, bound = 0.0, 0.0  # the wide bound of the first coefficient has been tried
    for order in range(first, ORDER + 1):
        if order > first:
            value, bound = rough_coefficient(lin, k, g, order, work)
        if not abs(value) > bound:
            value, bound = linear_coefficient(lin, k, g, order, work.x_after, work.slopes, work)
        work.judged[0, g, order], work.judged[1, g, order] = value, bound
        if abs(value) > bound:
            return
