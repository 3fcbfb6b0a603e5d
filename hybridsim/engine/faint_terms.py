"""Where a Taylor step has to end for an exponential or a root whose series shows nothing of what comes.

Of a rate such as exp(-((t - 1)/w)**2) or 1 + exp(-(v/w)**2) no term is seen far away: they are below rounding where a
step begins, and may be at its end, with all of the pulse between. The argument u is seen all the way. A step ends where
|u| becomes small, beyond which the series show what comes, and where exp(u) is largest inside of a step, at which the
look at the end of the step shows it. The same holds for hyperbolic functions, which differ from their limits by
exponentials, and for roots: v/sqrt(v**2 + w**2) is 1 or -1 far away, and its series shows no change of sign.
"""

from __future__ import annotations

from typing import Any

from hybridsim.engine.jit import inlined, kernel

HYPERBOLIC, EXPONENTIAL, ROOT, KINDS = range(4)
# Where exp(u) changes by a factor of exp(8) or less within a step its series shows it.
_SEEN = 8.0
# |u| from which on exp(u) is faint, and where in between the step ends that comes from there; from farther away it ends
# at such shares of |u|: near a multiple zero of u rounding is all that its series shows
_FAINT, _NEAR = 7.0, 4.0
_FAR_SHARE, _NEAR_SHARE = 0.01, 0.005
_NOTHING = 745.0  # exp(-745) is the last double
_ERROR, _SHARE = 0.1, 1e-6  # what the last terms of u may be; or of how far exp(u) is from being a double
# share of a step to which they may shorten it: u may have a pole that the rates do not
_SHORTEST = 1.0 / 64.0
_PARTS = 16  # of a step: in each of them u is taken to have one extremum
_POLISHED = 6  # steps of Newton's method
_HALVED = 40  # times, at most, between two parts


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
    """Bounds of |u(d) - u(0)|, and of |h (u'(d) - u'(0))|, for d in a step h; the size of the last two terms."""
    size, power = abs(u[1] * h), h
    change, turn, before = size, 0.0, 0.0
    for k in range(2, order + 1):
        before, power = size, power * h
        size = abs(u[k] * power)
        change += size
        turn += k * size
    return change, turn, before + size


@kernel
def where_it_ends(u: Any, kind: int, order: int, h: float) -> float:
    """How far a step of length h may go for a function of u, by its kind; u (order + 1,): the series.

    h may be negative; order >= 2.
    """
    if kind == ROOT:
        return where_a_root_ends(u, order, h)
    is_exponential = kind == EXPONENTIAL
    change, turn, last = _sizes(u, order, h)
    if not change > _SEEN:
        return h
    start = abs(u[0])
    error = max(_ERROR, _SHARE * (start - _NOTHING))
    if last > error:
        h *= max(_SHORTEST, (error / last) ** (1.0 / (order - 1)))
        change, turn, last = _sizes(u, order, h)
    high, low = max(_FAINT, _FAR_SHARE * start), max(_NEAR, _NEAR_SHARE * start)
    comes_near = start > _FAINT and start - change < low
    if not change > _SEEN or start - change > _NOTHING or (turn < abs(u[1] * h) and not comes_near):
        return h
    sign = 1.0 if u[0] > 0.0 else -1.0
    part = h / _PARTS
    before, here = u[0] - u[1] * part, u[0]  # as if it went straight on beyond both ends
    for j in range(1, _PARTS + 2):
        after = _value(u, order, j * part) if j <= _PARTS else here + _slope(u, order, h) * part
        # an extremum about the point before this one
        rises, falls = before < here >= after, before > here <= after
        if (here <= 0.0 and rises) or (here > 0.0 and (falls or (is_exponential and rises))):
            d = _extremum(u, order, (j - 1) * part, abs(part))
            value, is_within = _value(u, order, d), d * h > 0.0 and abs(d) < abs(h)
            if is_within and start > _FAINT and sign * value < low:
                return _becomes_near(u, order, sign, high, low, max(j - 2, 0) * part, d)
            if is_within and (start - abs(value) > _SEEN or (is_exponential and value - u[0] > _SEEN)):
                return d
        if j <= _PARTS and start > _FAINT and sign * after < low:
            return _becomes_near(u, order, sign, high, low, (j - 1) * part, j * part)
        before, here = here, after
    return h


@kernel
def where_a_root_ends(u: Any, order: int, h: float) -> float:
    """The same for sqrt(u): before u falls to less than a hundredth, if it rises again within the step."""
    change, _, _ = _sizes(u, order, h)
    high, low = _FAR_SHARE * u[0], _NEAR_SHARE * u[0]
    if not (u[0] > 0.0 and u[0] - change < low):
        return h
    part = h / _PARTS
    before, here = u[0] - u[1] * part, u[0]
    for j in range(1, _PARTS + 2):
        after = _value(u, order, j * part) if j <= _PARTS else here + _slope(u, order, h) * part
        if before > here <= after:
            d = _extremum(u, order, (j - 1) * part, abs(part))
            if d * h > 0.0 and abs(d) < abs(h) and _value(u, order, d) < low:
                return _becomes_near(u, order, 1.0, high, low, max(j - 2, 0) * part, d)
        before, here = here, after
    return h


@inlined
def _extremum(u: Any, order: int, near: float, width: float) -> float:
    """Where the slope of u is zero, not farther than a width from a place."""
    d = near
    for _ in range(_POLISHED):
        slope, bend = 0.0, 0.0
        for k in range(order, 0, -1):
            bend = bend * d + slope
            slope = slope * d + k * u[k]
        if bend != 0.0:
            d -= slope / bend
        d = min(max(d, near - width), near + width)
    return d


@inlined
def _becomes_near(u: Any, order: int, sign: float, high: float, low: float, far: float, near: float) -> float:
    """Where |u| is between high and low, between a place where it is larger and one where it is less."""
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
