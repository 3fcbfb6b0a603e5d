"""This module shortens Taylor steps that would miss a narrow pulse of an exponential or a root.

For a rate such as exp(-((t - 1)/w)**2) or 1 + exp(-(v/w)**2) all terms are below rounding far away. This may
be so at the start and at the end of a step that contains the whole pulse. The series of the argument u has no
such gap. A step ends where |u| becomes small, beyond which the series show the pulse. It also ends where
exp(u) is largest inside a step, so that the test at the end of the step detects it. The same holds for
hyperbolic functions, which differ from their limits by exponentials, and for roots: v/sqrt(v**2 + w**2) is 1
or -1 far away, and its series shows no change of sign. A power of an exponential fades earlier: u is
multiplied by the power.
"""

from __future__ import annotations

from typing import Any

from hybridsim.engine.native.kernels import call_noinline, call_series, inlined, kernel
from hybridsim.engine.roots.first_exit import halve, to_bernstein
from hybridsim.engine.series.vanishing_kinds import EXPONENTIAL, ROOT

# If exp(u) changes by a factor of exp(8) or less within a step, its series shows it.
_SEEN = 8.0
# |u| above which exp(u) is negligible, and |u| at the end of a step that starts there. A step from farther away ends
# at these shares of |u|, because near a multiple zero of u its series shows only rounding
_NEGLIGIBLE, _NEAR = 7.0, 4.0
_FAR_SHARE, _NEAR_SHARE = 0.01, 0.005
_NOTHING = 745.0  # exp(-745) is the smallest double
_ERROR, _SHARE = (
    0.1,
    1e-6,
)  # largest last terms of u, absolute or as a share of the distance of exp(u) to underflow
# smallest share to which they may shorten a step: u may have a pole that the rates do not have
_SHORTEST = 1.0 / 64.0
# halvings of a step, and most pieces: the number of extrema of u is at most its order
_DEEPEST, _MAX_SUBDIVISIONS = 40, 400
STACK_ROWS = _DEEPEST + 2  # most pieces on the stack
_POLISHED, _CLOSE = 60, 1e-8  # most steps to an extremum, and its accuracy
_HALVED = 40  # most bisections between two places


@inlined
def _value(u: Any, order: int, d: float) -> float:
    value = u[order]
    for k in range(order - 1, -1, -1):
        value = value * d + u[k]
    return value


@inlined
def _slope(u: Any, order: int, d: float) -> float:
    slope = order * u[order]
    for k in range(order - 1, 0, -1):
        slope = slope * d + k * u[k]
    return slope


@inlined
def _sizes(u: Any, order: int, h: float) -> tuple[float, float, float]:
    """Return bounds of the changes of a Taylor series and of its slope in a step, and its last terms."""
    size, power = abs(u[1] * h), h
    change, turn, before = size, 0.0, 0.0
    for k in range(2, order + 1):
        before, power = size, power * h
        size = abs(u[k] * power)
        change += size
        turn += k * size
    return change, turn, before + size


@inlined
def may_end(u: Any, kind: int, size: float) -> bool:
    """Return, by a fast test, whether a function of the polynomial u may limit the step."""
    return kind == ROOT or size - abs(u[0]) > _SEEN


@kernel
def where_it_ends(u: Any, kind: int, order: int, h: float, a: Any, stack: Any, code: int) -> float:
    """Return the longest safe step, at most h, for a given kind of function of the Taylor series u.

    h may be negative; order >= 2. a (order,) or longer, stack (STACK_ROWS, order + 2) or larger: scratch space.
    code: address of a function that does `to_bernstein` for as many coefficients as the order
    (`hybridsim.engine.series.emit_bernstein`), 0 for none.
    """
    if kind == ROOT:
        return call_noinline(where_a_root_ends, (u, order, h, a, stack, code))
    change, turn, last = _sizes(u, order, h)
    if not change > _SEEN:
        return h
    start = abs(u[0])
    error = max(_ERROR, _SHARE * (start - _NOTHING))
    if last > error:
        h *= max(_SHORTEST, (error / last) ** (1.0 / (order - 1)))
        change, turn, last = _sizes(u, order, h)
    high, low = max(_NEGLIGIBLE, _FAR_SHARE * start), max(_NEAR, _NEAR_SHARE * start)
    comes_near = start > _NEGLIGIBLE and start - change < low
    if not change > _SEEN or start - change > _NOTHING or (turn < abs(u[1] * h) and not comes_near):
        return h
    if turn < abs(u[1] * h):  # monotonic
        sign = 1.0 if u[0] > 0.0 else -1.0
        if sign * _value(u, order, h) < low:
            return call_noinline(_becomes_near, (u, order, sign, high, low, 0.0, h))
        return h
    return call_noinline(_first_place, (u, order, h, kind, high, low, a, stack, code))


@kernel
def where_a_root_ends(u: Any, order: int, h: float, a: Any, stack: Any, code: int) -> float:
    """Return the longest safe step for sqrt(u): it ends before u comes close to zero and rises again."""
    change, _, _ = _sizes(u, order, h)
    high, low = _FAR_SHARE * u[0], _NEAR_SHARE * u[0]
    if not (u[0] > 0.0 and u[0] - change < low):
        return h
    return call_noinline(_first_place, (u, order, h, ROOT, high, low, a, stack, code))


@kernel
def _first_place(
    u: Any, order: int, h: float, kind: int, high: float, low: float, a: Any, stack: Any, code: int
) -> float:
    """Return the first point in a step at which the step has to end, or the end of the step.

    The step is divided into pieces on which u rises or falls. The slope is isolated in Bernstein form: if its
    coefficients change their sign at most once, so does the slope.
    """
    start, sign = abs(u[0]), 1.0 if u[0] > 0.0 else -1.0
    is_far = start > _NEGLIGIBLE and kind != ROOT
    power = 1.0
    for k in range(order):
        power *= h
        a[k] = (k + 1.0) * u[k + 1] * power
    if code != 0:
        call_series(code, 0.0, 0.0, a, a, a, stack)
    else:
        to_bernstein(a[:order], stack[0, :order])
    stack[0, order], stack[0, order + 1] = 0.0, 1.0
    top = 1
    for _ in range(_MAX_SUBDIVISIONS):
        top -= 1
        if top < 0:
            return h
        left, width = stack[top, order], stack[top, order + 1]
        changes, rises = _changes(stack[top, :order])
        if changes > 1 and width > 2.0**-_DEEPEST:
            halve(stack, top, order, a)
            top += 2
            continue
        near, far = left * h, (left + width) * h
        begins_low = (u[0] if left == 0.0 else _value(u, order, near)) < 0.0
        # otherwise |u| is largest there
        may_matter = rises if begins_low else not rises or kind == EXPONENTIAL
        if changes > 0 and may_matter:
            d = _extremum(u, order, near, far, rises)
            value = _value(u, order, d)
            if (is_far or (kind == ROOT and not rises)) and sign * value < low:
                return _becomes_near(u, order, sign, high, low, near, d)
            is_nearest = rises if value <= 0.0 else not rises or kind == EXPONENTIAL
            is_seen = start - abs(value) > _SEEN or (kind == EXPONENTIAL and value - u[0] > _SEEN)
            if kind != ROOT and is_nearest and is_seen and 0.0 < abs(d) < abs(h):
                return d
            near = d
        if is_far and sign * _value(u, order, far) < low:
            return _becomes_near(u, order, sign, high, low, near, far)
    return max(stack[top, order], _SHORTEST) * h  # rounding causes too many pieces


@inlined
def _changes(b: Any) -> tuple[int, bool]:
    """Return how often Bernstein coefficients change their sign, and whether the first coefficient is positive."""
    changes, last, first = 0, 0.0, 0.0
    for i in range(b.shape[0]):
        if b[i] != 0.0:
            changes += last * b[i] < 0.0
            last = 1.0 if b[i] > 0.0 else -1.0
            if first == 0.0:
                first = last
    return changes, first > 0.0


@inlined
def _extremum(u: Any, order: int, near: float, far: float, rises: bool) -> float:
    """Find the extremum of a polynomial u between two points, by Newton's method with bisection."""
    d = 0.5 * (near + far)
    for _ in range(_POLISHED):
        slope, bend = 0.0, 0.0
        for k in range(order, 0, -1):
            bend = bend * d + slope
            slope = slope * d + k * u[k]
        if slope == 0.0:
            return d
        if (slope * (far - near) > 0.0) == rises:
            near = d
        else:
            far = d
        moved = d - slope / bend if bend != 0.0 else d
        if not min(near, far) < moved < max(near, far):
            moved = 0.5 * (near + far)
        if abs(moved - d) <= _CLOSE * abs(d):
            return moved
        d = moved
    return d


@kernel
def _becomes_near(u: Any, order: int, sign: float, high: float, low: float, far: float, near: float) -> float:
    """Find a point at which the absolute value of a polynomial u lies between two bounds, by bisection."""
    d = near
    for _ in range(_HALVED):
        d = 0.5 * (far + near)
        value = sign * _value(u, order, d)
        if value > high:
            far = d
        elif value < low:
            near = d
        else:
            return d
    return d
