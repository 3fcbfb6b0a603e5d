"""Linear modes in compiled code: functions of time, exponentials, guards and their first zeros.

The arrays are those of `hybridsim.engine.linear.tables`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hybridsim.engine.linear.form import ANGLE, GROWTH, TIME
from hybridsim.engine.linear.guards import FARTHEST, guard_terms
from hybridsim.engine.native.constants import BOUND_TERMS
from hybridsim.engine.native.kernels import allocating_kernel, call_noinline, inlined, kernel
from hybridsim.engine.native.loop_hints import index, short_loop
from hybridsim.engine.native.simd.products import product, times
from hybridsim.engine.roots.certify import falls_over, past_dip, safe_step, stays_positive, zero_of_terms
from hybridsim.engine.roots.first_exit import FOUND, NEVER, OPEN
from hybridsim.engine.series.bounded import UNIT

_SPREAD = 2.0  # largest norm for which the exponential of a block less its mean is summed in one part
_PARTS = 10**6  # most parts of that size, about one second of work
_ITERATIONS = 100
_TERMS = 30  # most terms of a series near its start, in addition to the number of states
# A guard is followed from at most this many points, which takes a second, so that a run can be interrupted. Points of a
# block with many coordinates count in proportion to its entries.
POINTS = 10**6
# A damped motion grows backward, by at most exp(1) over this share of the forward range of a polynomial.
_TURNED = 2.0  # roundings: of the speed and of its product with the time
_BACK, _BACKWARD = 1.0 / FARTHEST, 4.0
_EVEN = 0.5  # of the range of a polynomial: a step after which the bound of the remainder is still small


@inlined
def size_of(z: complex) -> float:
    """Return an upper bound of a complex modulus without a square root; the bound is at most 1.5 times too large."""
    return abs(z.real) + abs(z.imag)


@inlined
def functions_of_time(lin: Any, s: float, p: Any, factors: Any, w: Any) -> None:
    """Compute the monomials of the functions of time at local time `s`.

    factors: scratch space for values of atoms, (2 A + 1, 2), with a one at its end. The second column holds a
    bound of the error of each argument, without the error of s.
    """
    for a in range(lin.kinds.shape[0]):
        kind, rate, angle = lin.kinds[a], lin.rates[a], lin.offsets[a]
        value, other = factors[2 * a], factors[2 * a + 1]
        if kind == TIME:
            value[0] = s
            continue
        error = UNIT * abs(angle)
        first = lin.term_start[a]
        for i in range(first, lin.term_start[a + 1]):
            short_loop()
            source, weight = index(lin.sources[i]), lin.weights[i]
            term = weight * p[source]
            angle += term
            if lin.phases[0] <= source < lin.phases[1]:
                error += 2.0 * UNIT * abs(term)
            if weight != 1.0 or i > first:
                error += 2.0 * UNIT * abs(term)
        turned = rate * s
        angle += turned
        if rate != 0.0:
            error += UNIT * (abs(turned) + abs(angle))
        value[1] = error
        if kind == ANGLE:
            value[0], other[0] = math.sin(angle), math.cos(angle)
        elif kind == GROWTH:
            value[0] = math.inf if angle >= 709.0 else math.exp(angle)  # math.exp raises an exception beyond
        else:
            value[0] = angle
    for m in range(w.shape[0]):
        short_loop()
        product, row = 1.0, lin.factors[m]
        for i in range(row.shape[0]):
            short_loop()
            product *= factors[index(row[i]), 0]
        w[m] = product


@inlined
def errors_of_time(lin: Any, s_error: float, factors: Any, w_error: Any) -> None:
    """Compute error bounds of the results of the last `functions_of_time`, from the error of the local time."""
    for a in range(lin.kinds.shape[0]):
        kind, value, other = lin.kinds[a], factors[2 * a], factors[2 * a + 1]
        if kind == TIME:
            value[1] = s_error
            continue
        error = value[1] + abs(lin.rates[a]) * s_error
        if kind == ANGLE:
            one, two, rest = abs(value[0]), abs(other[0]), 0.5 * error * error
            value[1] = two * error + rest + 2.0 * UNIT * one
            other[1] = one * error + rest + 2.0 * UNIT * two
        elif kind == GROWTH:
            value[1] = value[0] * (error + 2.0 * UNIT)
        else:
            value[1] = error
    for m in range(w_error.shape[0]):
        short_loop()
        product, error, row = 1.0, 0.0, lin.factors[m]
        for i in range(row.shape[0]):
            short_loop()
            factor = factors[index(row[i])]
            v, e = factor[0], factor[1]
            error = error * (abs(v) + e) + abs(product) * e
            product *= v
            if i > 0:
                error += UNIT * abs(product)
        w_error[m] = error


@inlined
def to_modal(lin: Any, k: int, x: Any, w: Any, c: Any) -> None:
    """Compute the modal coordinates of the states and functions of time."""
    for q in range(lin.inverse.shape[1]):
        short_loop()
        a, b, d, e = times(lin.inverse, (k, q), (x, w))
        c[2 * q], c[2 * q + 1] = complex(a, b), complex(d, e)


@inlined
def moved(lin: Any, k: int, c: Any, d: float, out: Any) -> None:
    """Compute the modal coordinates after a time d: exp(B d) c."""
    j = 0
    values, ends, count = lin.values[k], lin.ends[k], lin.counts[k]
    while j < count:
        short_loop()
        end = ends[j]
        if end == j + 1:
            value = values[j]
            if value == 0.0:
                out[j] = c[j]
            else:
                size = math.exp(min(value.real * d, 709.0)) if value.real != 0.0 else 1.0
                angle = value.imag * d
                out[j] = c[j] * complex(size * math.cos(angle), size * math.sin(angle))
        else:
            call_noinline(_move_block, (lin, k, j, end, c, d, out))
        j = index(end)
    while j < out.shape[0]:  # zeros; LLVM would call a function to write them as such
        short_loop()
        out[j] = c[j]
        j += 1


@allocating_kernel
def _move_block(lin: Any, k: int, first: int, end: int, c: Any, d: float, out: Any) -> None:
    """Advance a block of coordinates by an exponential and a Taylor series; for too long times the result is NaN."""
    size = end - first
    mean = 0.0 + 0.0j
    for j in range(first, end):
        mean += lin.values[k, j] / size
    spread = 0.0
    for j in range(first, end):
        row = abs(lin.values[k, j] - mean)
        for i in range(j + 1, end):
            row += abs(lin.upper[k, j, i])
        spread = max(spread, row)
    if not spread * abs(d) <= _SPREAD * _PARTS:
        for j in range(first, end):
            out[j] = complex(math.nan, math.nan)
        return
    parts = max(1, math.ceil(spread * abs(d) / _SPREAD))
    h = d / parts
    factor = np.exp(mean * h)
    term, total = np.empty(size, dtype=np.complex128), np.empty(size, dtype=np.complex128)
    for j in range(size):
        out[first + j] = c[first + j]
    for _ in range(parts):
        for j in range(size):
            total[j] = term[j] = out[first + j]
        for order in range(1, _ITERATIONS):
            grown, whole = 0.0, 0.0
            for j in range(size):  # upper triangular: row j uses no earlier coordinate
                value = (lin.values[k, first + j] - mean) * term[j]
                for i in range(j + 1, size):
                    value += lin.upper[k, first + j, first + i] * term[i]
                term[j] = value * (h / order)
                total[j] += term[j]
                grown, whole = grown + size_of(term[j]), whole + size_of(total[j])
            if not grown > 0.125 * UNIT * whole:
                break
        for j in range(size):
            out[first + j] = factor * total[j]


@inlined
def states_of(lin: Any, k: int, c: Any, x: Any) -> None:
    """Compute the states from the modal coordinates `c`."""
    product(lin.states, k, (c,), x)


@kernel
def states_near_start(lin: Any, k: int, x: Any, w: Any, s: float, terms: Any, out: Any) -> None:
    """Compute states a short time after a start, each with a small relative error, by a Taylor series.

    Modal coordinates give a state with an error relative to the largest state, and a state that grows from
    zero is smaller than this error at first. terms (2, n + M): scratch space. See `LinearTables.near`.
    """
    n, size = x.shape[0], terms.shape[1]
    term, following = terms[0], terms[1]
    for i in range(size):
        term[i] = x[i] if i < n else w[i - n]
    for i in range(n):
        out[i] = x[i]
    for order in range(1, size + _TERMS):
        is_small = order > size  # before it a state may have no term yet
        for i in range(size):
            total = 0.0
            for j in range(size):
                if lin.flows[k, i, j] != 0.0:
                    total += lin.flows[k, i, j] * term[j]
            following[i] = total * (s / order)
        for i in range(size):
            term[i] = following[i]
        for i in range(n):
            out[i] += term[i]
            is_small = is_small and abs(term[i]) <= 0.125 * UNIT * abs(out[i])
        if is_small:
            break


@inlined
def slopes_of(lin: Any, k: int, x: Any, w: Any, out: Any) -> None:
    """Compute the rates of the states from the states and functions of time."""
    product(lin.slopes, k, (x, w), out)


@inlined
def state_sizes(lin: Any, k: int, before: Any, after: Any, larger: Any, scale: Any) -> None:
    """Compute bounds of the terms that add up to each state, at the start and the end of a segment.

    larger: scratch space for the sizes of the coordinates.
    """
    for j in range(before.shape[0]):
        short_loop()
        larger[j] = max(size_of(before[j]), size_of(after[j]))
    product(lin.spreads, k, (larger,), scale)


@inlined
def first_zero_of_wave(lin: Any, k: int, g: int, c: Any, bound: float) -> tuple[int, float]:
    """Find the first zero of a guard a + r cos(omega s + phase), or OPEN if this zero is nearly double."""
    j, terms = lin.waves[k, g], lin.terms
    level, size = 0.0, 0.0
    for i in range(lin.counts[k]):
        size += lin.sizes[k, g, i] * size_of(c[i])
        if i != j:
            level += terms[k, g, i, 0, 0] * c[i].real - terms[k, g, i, 1, 0] * c[i].imag
    u, v = terms[k, g, j, 0, 0], terms[k, g, j, 1, 0]
    real, imaginary = u * c[j].real - v * c[j].imag, u * c[j].imag + v * c[j].real
    error = (16.0 + 2.0 * lin.counts[k]) * UNIT * size
    radius = math.sqrt(real * real + imaginary * imaginary)
    if level > radius + error:
        return NEVER, bound
    steepness = (radius - level) * (radius + level)  # the square of its slope at the zero, over omega**2
    # beyond the zero the guard has to fall below its error
    if not (level + real > error and steepness > 0.0 and 8.0 * error * abs(level) <= steepness):
        return OPEN, 0.0
    angle = math.acos(-level / radius) - math.atan2(imaginary, real)
    if angle <= 0.0:
        angle += 2.0 * math.pi
    s = angle / lin.values[k, j].imag
    return (FOUND, s) if s <= bound else (NEVER, bound)


@kernel
def first_zero(lin: Any, k: int, g: int, i: int, bound: float, state: Any, scratch: Any) -> tuple[int, float]:
    """Find the first time in (0, bound] at which a guard becomes negative; return NEVER, FOUND or OPEN.

    OPEN means that rounding leaves the zero undecided. The guard is positive just after 0; its first `orders`
    coefficients are set to zero, with an uncertainty `floors`. Row i of `starts` holds its Taylor
    coefficients at 0, followed by their bounds. `hints` holds a guess of its zero (0: none). A guess that is
    a zero, with a certainly positive guard before it, is the result. Otherwise the guard is followed from
    point to point: its Taylor polynomial less the largest remainder is a lower bound, so that no zero is
    passed over. Once the polynomial is accurate to rounding up to the zero, its zero is the result.
    """
    k, g, i = index(k), index(g), index(i)
    side, order, floor = state.sides[g], state.orders[g], state.floors[g]
    c, v, start, hint = scratch.c, scratch.v, scratch.starts[i], scratch.hints[k, g]
    terms, lower = scratch.terms[0], scratch.terms[1]
    size, rest = start[BOUND_TERMS], start[BOUND_TERMS + 1]
    if not size < math.inf:
        return OPEN, 0.0
    if size == 0.0 and side >= 0:
        return NEVER, bound
    if side <= 0 or order >= BOUND_TERMS - 3 or not start[order] > 0.0:
        return OPEN, 0.0
    farthest, grown, margin = lin.farthest[k, g], lin.grown[k, g], lin.margins[k, g]
    turning = _TURNED * UNIT * lin.turning[k, g]
    is_due = 0.0 < hint <= min(bound, farthest)
    if not is_due and bound <= farthest and stays_positive(start, order, grown * rest, bound, margin * size):
        return NEVER, bound
    if is_due:
        moved(lin, k, c, hint, v)
        size_there, rest_there = guard_terms(lin, k, g, v, terms, scratch.products)
        margin_there = margin + turning * hint
        error = margin_there * size_there + floor
        rest_there *= _BACKWARD * grown
        d = zero_of_terms(terms, rest_there, size_there, lower)
        if d == d and 16.0 * error * abs(terms[2]) <= terms[1] * terms[1]:
            width = falls_over(terms, rest_there, min(hint, _BACK * farthest))
            if abs(d) < width and (
                width == hint or stays_positive(start, order, grown * rest, hint - width, margin_there * size)
            ):
                return (FOUND, hint + d) if hint + d <= bound else (NEVER, bound)
    for i in range(BOUND_TERMS):
        terms[i] = start[i]
    s, error, widest = 0.0, margin * size + floor, 1
    for j in range(lin.counts[k]):
        widest = max(widest, lin.ends[k, j] - j)
    for _ in range(POINTS // (widest * widest)):
        scratch.points[0] += widest * widest
        reach = min(bound - s, farthest)
        d = min(reach, _EVEN * farthest) if lin.is_polynomial[k, g] != 0 else 0.0
        if d == 0.0 or not stays_positive(terms, order, grown * rest, d, margin * size):
            d = past_dip(terms, order, reach, error, lower)
        if d == 0.0 or not stays_positive(terms, order, grown * rest, d, margin * size):
            d = safe_step(terms, order, grown * rest, reach, margin * size, lower)
        if d >= bound - s:
            return NEVER, bound
        if not s + d > s:
            return OPEN, s
        s += d
        moved(lin, k, c, s, v)
        size, rest = guard_terms(lin, k, g, v, terms, scratch.products)
        margin = lin.margins[k, g] + turning * s
        error = margin * size + floor
        order, floor = 0, 0.0
        d = zero_of_terms(terms, grown * rest, size, lower)
        # beyond the zero the guard has to fall below its error
        if d == d and 16.0 * error * abs(terms[2]) <= terms[1] * terms[1]:
            return (FOUND, s + d) if s + d <= bound else (NEVER, bound)
        if not terms[0] > error:
            return OPEN, s
    return OPEN, s
