"""This module computes Taylor series of Python functions by finite differences, with error bounds.

With x_1 = f(s, x), the rate of f along the straight path x + x_1 h is 2 x_2, and its second derivative along
x + x_1 h + x_2 h**2 is 6 x_3, because higher terms of the path do not enter. No integration is needed, only derivatives
at h = 0 of functions of one variable. Each derivative comes from two central differences of neighbouring order on the
same nine points (Fornberg 1988, doi:10.1090/S0025-5718-1988-0935077-0, table 1). Their difference bounds the truncation
error. Steps are tried from very short ones upward, until truncation and rounding errors grow again.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import allocating_kernel, call, kernel
from hybridsim.engine.series.bounded import ORDER, UNIT

# Weights of f(k h) - f(-k h), or of f(k h) + f(-k h) - 2 f(0) for even derivatives, k = 1..4, divided by the factorial
# of the order: the formula on nine points, then the one on seven points for comparison.
_WEIGHTS = np.array(
    [
        [[4 / 5, -1 / 5, 4 / 105, -1 / 280], [3 / 4, -3 / 20, 1 / 60, 0.0]],
        [[4 / 5, -1 / 10, 4 / 315, -1 / 1120], [3 / 4, -3 / 40, 1 / 180, 0.0]],
        [[-61 / 180, 169 / 720, -1 / 20, 7 / 1440], [-13 / 48, 1 / 6, -1 / 48, 0.0]],
    ]
)
_GAIN = np.abs(_WEIGHTS[:, 0]).sum(axis=1) * np.array(
    [2.0, 4.0, 2.0]
)  # amplification of the rounding of values
# not a power of two, so that a function with period 1 is not sampled at whole periods
_SHORTEST = 0.618 * 2.0**-56
_RATIO, _LEVELS = 8.0, 23
_WORSE = 16.0  # ratio to the best bound at which the step counts as too long
# shift of a state in units of rounding, so that its effect exceeds the noise
_APART = 2.0**10
_SMALLEST = 2.0**-40  # shift of a state of unknown size


@kernel
def _at(function: Any, s: float, moving: float, C: Any, h: float, p: Any, z: Any, x: Any, out: Any) -> None:
    """Evaluate a function at one point of a polynomial path of the states."""
    for i in range(C.shape[0]):
        total = C[i, 3]
        for k in range(2, -1, -1):
            total = total * h + C[i, k]
        x[i] = total
    call(function, s + moving * h, x, p, z, out)


@allocating_kernel
def _noise(function: Any, s: float, t: float, C: Any, p: Any, z: Any, x: Any, low: Any, high: Any) -> Any:
    """Return the rounding error (m,) of a function's values, including the rounding of its arguments."""
    m, n = low.shape[0], C.shape[0]
    noise = np.zeros(m)
    x[:] = C[:, 0]
    for j in range(-1, n):
        unit = UNIT * abs(t if j < 0 else x[j])
        if unit == 0.0:
            continue
        for sign in (-1.0, 1.0):
            out = low if sign < 0.0 else high
            if j < 0:
                call(function, s + sign * _APART * unit, x, p, z, out)
            else:
                x[j] = C[j, 0] + sign * _APART * unit
                call(function, s, x, p, z, out)
                x[j] = C[j, 0]
        for i in range(m):
            effect = abs(high[i] - low[i]) / (2.0 * _APART)
            noise[i] += effect if effect < np.inf else 0.0
    return noise


@allocating_kernel
def along(
    function: Any, s: float, t: float, moving: float, C: Any, p: Any, z: Any, D: Any, B: Any, H: Any
) -> None:
    """Compute Taylor coefficients (m, 4) of a function along a path by finite differences, with error bounds.

    C (n, 4): the path, as in `_at`. moving: 1 if time advances along the path, else 0.
    """
    m, n = D.shape[0], C.shape[0]
    x, values, scatter = np.empty(n), np.empty((9, m)), np.zeros((m, ORDER + 1))
    noise = _noise(function, s, t, C, p, z, x, values[0], values[1])
    _at(function, s, moving, C, 0.0, p, z, x, values[4])
    open_ = np.ones((m, ORDER + 1), dtype=np.bool_)
    for i in range(m):
        D[i, 0] = values[4, i]
        B[i, 0] = noise[i] + 2.0 * UNIT * abs(values[4, i])
        for k in range(1, ORDER + 1):
            D[i, k], B[i, k], H[i, k] = 0.0, np.inf, 0.0
    h = _SHORTEST
    varied = np.zeros(m, dtype=np.bool_)
    for _ in range(_LEVELS):
        for k in range(-4, 5):
            if k != 0:
                _at(function, s, moving, C, k * h, p, z, x, values[4 + k])
        any_open = False
        for i in range(m):
            middle, size, varies, finite = values[4, i], abs(values[4, i]), False, True
            for k in range(9):
                finite = finite and abs(values[k, i]) < np.inf
                size = max(size, abs(values[k, i]))
                varies = varies or values[k, i] != middle
            if not finite:  # outside the domain of the function; longer steps do not help
                open_[i, 1:] = False
                continue
            if not open_[i, 1:].any():
                continue
            if not varies:  # the step is too short, or the function is constant
                any_open = True
                continue
            varied[i] = True
            power = 1.0
            for d in range(1, ORDER + 1):
                power *= h
                if not open_[i, d]:
                    continue
                better, other = 0.0, 0.0
                for k in range(1, 5):
                    pair = values[4 + k, i] - values[4 - k, i]
                    if d == 2:
                        pair = (values[4 + k, i] - middle) + (values[4 - k, i] - middle)
                    better += _WEIGHTS[d - 1, 0, k - 1] * pair
                    other += _WEIGHTS[d - 1, 1, k - 1] * pair
                apart = abs(better - other)
                scatter[i, d] = max(scatter[i, d], apart)  # this shows rounding inside the function
                rounding = max(_GAIN[d - 1] * noise[i], scatter[i, d]) + _GAIN[d - 1] * UNIT * size
                bound = (2.0 * apart + rounding) / power
                if bound < B[i, d]:
                    D[i, d], B[i, d], H[i, d] = better / power, bound, h
                elif not bound <= _WORSE * B[i, d] and B[i, d] < np.inf:
                    open_[i, d] = False
                any_open = any_open or open_[i, d]
        if not any_open:
            break
        h *= _RATIO
    for i in range(m):
        if not varied[i] and abs(values[4, i]) < np.inf:  # it was constant for all steps
            B[i, 1:] = 0.0
        for k in range(ORDER + 1):
            if not (abs(D[i, k]) < np.inf and B[i, k] < np.inf):
                D[i, k], B[i, k] = np.nan, np.nan


@allocating_kernel
def _path(flow: Any, s: float, t: float, x: Any, p: Any, z: Any, C: Any, E: Any, H: Any) -> None:
    """Write the Taylor coefficients (n, 4) of the states along the flow, with bounds and step sizes."""
    D, B = np.empty_like(C), np.empty_like(C)
    C[:], E[:], H[:] = 0.0, 0.0, 0.0
    C[:, 0] = x
    rate = np.empty(x.shape[0])
    call(flow, s, x, p, z, rate)
    C[:, 1] = rate
    for k in range(2, ORDER + 1):
        along(flow, s, t, 1.0, C, p, z, D, B, H)
        C[:, k], E[:, k] = D[:, k - 1] / k, B[:, k - 1] / k
        E[:, 1] = B[:, 0]


@allocating_kernel
def _series(
    flow: Any,
    guards_and_monitors: Any,
    s: float,
    t: float,
    x: Any,
    p: Any,
    z: Any,
    C: Any,
    E: Any,
    H: Any,
    G: Any,
    GE: Any,
) -> None:
    """Write the Taylor coefficients of states, guards and monitors along the flow, with bounds."""
    _path(flow, s, t, x, p, z, C, E, H)
    if G.shape[0]:
        along(guards_and_monitors, s, t, 1.0, C, p, z, G, GE, np.empty_like(G))


@allocating_kernel
def run_differences(
    flow: Any, guards_and_monitors: Any, s: float, t: float, s_error: float, x: Any, x_error: Any, p: Any, z: Any,
    C: Any, G: Any, GE: Any,
) -> None:  # fmt: skip
    """Write the Taylor coefficients of states (n, 4), and of guards and monitors (m, 4) with bounds.

    s: local time, t: absolute time. s_error, x_error: errors of time and states. Their effect on each coefficient is
    measured by small shifts. Without them the bounds contain only step and rounding errors.
    """
    n, m = x.shape[0], G.shape[0]
    E, H = np.empty((n, ORDER + 1)), np.empty((n, ORDER + 1))
    _series(flow, guards_and_monitors, s, t, x, p, z, C, E, H, G, GE)
    known_exactly = not s_error > 0.0
    for i in range(n):
        known_exactly = known_exactly and not x_error[i] > 0.0
    if m == 0 or known_exactly:
        return
    moved, C1, E1, H1 = x.copy(), np.empty_like(C), np.empty_like(C), np.empty_like(C)
    G1, GE1 = np.empty_like(G), np.empty_like(G)
    for j in range(-1, n):
        error = s_error if j < 0 else x_error[j]
        if j < 0 and error == 0.0:
            continue
        d = _APART * max(error, UNIT * abs(t if j < 0 else x[j]))
        if j >= 0:
            d = max(d, _APART * UNIT * abs(C[j, 1]) * H[j, 1])
        d = d if d > 0.0 else _SMALLEST
        for sign in (1.0, -1.0):  # the second direction is for states at the edge of the domain
            if j < 0:
                _series(flow, guards_and_monitors, s + sign * d, t + sign * d, x, p, z, C1, E1, H1, G1, GE1)
            else:
                moved[j] = x[j] + sign * d
                _series(flow, guards_and_monitors, s, t, moved, p, z, C1, E1, H1, G1, GE1)
                moved[j] = x[j]
            if np.isfinite(G1).all():
                break
        for i in range(m):
            slope = (abs(G1[i, 0] - G[i, 0]) + GE1[i, 0]) / d
            for k in range(ORDER + 1):
                GE[i, k] += error * abs(G1[i, k] - G[i, k]) / d
                if j >= 0 and k > 0 and E[j, k] > 0.0:
                    GE[i, k] += slope * E[j, k]
            if j >= 0 and E[j, 2] > 0.0 and H[j, 1] > 0.0:
                GE[i, ORDER] += slope * E[j, 2] / H[j, 1]


@allocating_kernel
def run_jacobian(flow: Any, s: float, t: float, x: Any, p: Any, z: Any, out: Any) -> None:
    """Write the Jacobian d(dx/dt)/dx (n, n) to `out`."""
    n = x.shape[0]
    D, B, H = np.empty((n, ORDER + 1)), np.empty((n, ORDER + 1)), np.empty((n, ORDER + 1))
    C = np.zeros((n, ORDER + 1))
    C[:, 0] = x
    for j in range(n):
        C[j, 1] = 1.0
        along(flow, s, t, 0.0, C, p, z, D, B, H)
        C[j, 1] = 0.0
        out[:, j] = D[:, 1]
