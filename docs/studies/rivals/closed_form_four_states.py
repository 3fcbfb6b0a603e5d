"""The limit for two coupled masses with Coulomb contacts: the closed form of each of the modes, by hand in numba.

Of each pattern of stick the matrix is decomposed once. A piece is marched on an even grid by turning the phasors of its
eigenvalues, so that a grid point costs no sine; where a guard changes its sign, or dips between two points, its zero
is found by Newton's method on the closed form.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from rivals.decomposition import decomposed, full_matrix
from rivals.method import Method, Result, Runs
from rivals.scenes import Scene

_SHARE = 8  # grid points in the shortest of the periods: a guard bends but once between two


@numba.njit(cache=True)
def _guards(
    mode: Any,
    limits: Any,
    full: Any,
    lam: Any,
    vec: Any,
    rest: Any,
    response: Any,
    F0: float,
    w: float,
    rows: Any,
    kinds: Any,
) -> int:
    """Guards of a mode as g = constant + Re(sum of coefficient times phasor): rows (constant, two modes, drive).

    kinds: mass, and what follows a held mass that is released, 0 for the end of a slip.
    """
    count = 0
    for j in range(2):
        if mode[j] != 0:
            rows[count, 0] = mode[j] * rest[2 * j + 1]
            for q in range(2):
                rows[count, 1 + q] = mode[j] * 2.0 * vec[2 * j + 1, q]
            rows[count, 3] = mode[j] * response[2 * j + 1]
            kinds[count, 0], kinds[count, 1] = j, 0
            count += 1
            continue
        for sign in (1, -1):
            rows[count, 0] = limits[j] + 0j
            for q in range(1, 4):
                rows[count, q] = 0.0
            for i in range(4):
                rows[count, 0] -= sign * full[2 * j + 1, i] * rest[i]
                for q in range(2):
                    rows[count, 1 + q] -= sign * full[2 * j + 1, i] * 2.0 * vec[i, q]
                rows[count, 3] -= sign * full[2 * j + 1, i] * response[i]
            if j == 0:
                rows[count, 3] -= sign * F0
            kinds[count, 0], kinds[count, 1] = j, sign
            count += 1
    return count


@numba.njit(cache=True)
def _value(row: Any, c: Any, rates: Any, s: float) -> tuple[float, float, float]:
    """A guard, its slope and its bend at local time s; c: amplitudes, of the drive last (its imaginary part counts)."""
    value, slope, bend = row[0].real, 0.0, 0.0
    for q in range(3):
        if c[q] == 0.0 or row[1 + q] == 0.0:
            continue
        turned = rates[q] * s
        size = math.exp(turned.real)
        term = row[1 + q] * c[q] * complex(size * math.cos(turned.imag), size * math.sin(turned.imag))
        first = rates[q] * term
        second = rates[q] * first
        value += term.real
        slope += first.real
        bend += second.real
    return value, slope, bend


@numba.njit(cache=True, inline="always")
def _cubic_zero(h: float, v0: float, slope0: float, v1: float, slope1: float) -> float:
    """Where the cubic through both ends of an interval is zero, from its start; v0 > 0 >= v1."""
    a, b = h * slope0, h * slope1
    c2, c3 = 3.0 * (v1 - v0) - 2.0 * a - b, 2.0 * (v0 - v1) + a + b
    u = v0 / (v0 - v1)
    for _ in range(3):
        u -= (v0 + u * (a + u * (c2 + u * c3))) / (a + u * (2.0 * c2 + u * 3.0 * c3))
    return u * h


@numba.njit(cache=True)
def _follow(
    full: Any,
    tables: Any,
    limits: Any,
    F0: float,
    w: float,
    h: float,
    end: float,
    t_out: Any,
    what_out: Any,
    x_out: Any,
    grid: Any,
    states: Any,
) -> int:
    """Events into t_out, what_out (mass, what follows), x_out; states on the grid; gives the number of events."""
    all_rates, all_vectors, all_inverses, all_centres, all_responses = tables
    x, mode = np.zeros(4), np.zeros(2, dtype=np.int64)
    rows, kinds = np.empty((4, 4), dtype=np.complex128), np.empty((4, 2), dtype=np.int64)
    phasors = np.empty((4, 3), dtype=np.complex128)
    c, rates, turn, now = phasors[0], phasors[1], phasors[2], phasors[3]
    steep_rows = np.empty((4, 3), dtype=np.complex128)
    before, slopes = np.empty(4), np.empty(4)
    put_in, rest = np.empty(4), np.empty(4)
    count, point, turns, angle = 0, 0, 0, 0.0
    period = 2.0 * math.pi / w
    # the mass that has just been released or has turned: its guard is zero where the piece begins
    released = -1
    turn_drive = complex(math.cos(w * h), math.sin(w * h))
    while True:
        start = turns * period + angle / w
        pattern = (mode[0] == 0) + 2 * (mode[1] == 0)
        lam, vec, inv = all_rates[pattern], all_vectors[pattern], all_inverses[pattern]
        response = all_responses[pattern]
        for j in range(2):
            put_in[2 * j] = x[2 * j] if mode[j] == 0 else 0.0
            put_in[2 * j + 1] = mode[j] * limits[j]
        centre = all_centres[pattern]
        for i in range(4):
            rest[i] = 0.0
            for k in range(4):
                rest[i] += centre[i, k] * put_in[k]
        for j in range(2):
            if mode[j] == 0:
                rest[2 * j] = x[2 * j]
        # exp(i (angle + w s)) / i: its real part is the sine
        drive = complex(math.sin(angle), -math.cos(angle))
        for q in range(2):
            c[q] = 0.0
            for i in range(4):
                c[q] += inv[q, i] * (x[i] - rest[i] - (response[i] * drive).real)
            rates[q] = lam[q]
            size = math.exp(lam[q].real * h)
            turn[q] = complex(size * math.cos(lam[q].imag * h), size * math.sin(lam[q].imag * h))
        c[2], rates[2], turn[2] = drive, complex(0.0, w), turn_drive
        number = _guards(mode, limits, full, lam, vec, rest, response, F0, w, rows, kinds)
        for q in range(3):
            now[q] = c[q]
        for g in range(number):
            before[g], slopes[g] = rows[g, 0].real, 0.0
            for q in range(3):
                steep_rows[g, q] = rates[q] * rows[g, 1 + q]
                before[g] += (rows[g, 1 + q] * c[q]).real
                slopes[g] += (steep_rows[g, q] * c[q]).real
            if kinds[g, 1] == 0 and kinds[g, 0] == released:
                before[g] = 0.0
        s, left = 0.0, end - start
        found, fired = math.inf, -1
        while fired < 0 and s <= left:
            s += h
            for q in range(3):
                now[q] *= turn[q]
            for g in range(number):
                value, slope = rows[g, 0].real, 0.0
                for q in range(3):
                    re, im = now[q].real, now[q].imag
                    value += rows[g, 1 + q].real * re - rows[g, 1 + q].imag * im
                    slope += steep_rows[g, q].real * re - steep_rows[g, q].imag * im
                low, high = s - h, math.inf
                if value <= 0.0:
                    high = s
                elif slopes[g] < 0.0 < slope and before[g] > 0.0:
                    dip = s - h * slope / (slope - slopes[g])
                    for _ in range(4):
                        at, steep, bend = _value(rows[g], c, rates, dip)
                        dip -= steep / bend
                    if _value(rows[g], c, rates, dip)[0] <= 0.0:
                        high = dip
                if high < math.inf:
                    if high == s and before[g] > 0.0:
                        at = low + _cubic_zero(h, before[g], slopes[g], value, slope)
                    else:
                        at = high if high < s else s - (value / slope if slope < 0.0 else 0.5 * h)
                    for _ in range(80):
                        if not low < at < high:
                            at = 0.5 * (low + high)
                        v, steep, _ = _value(rows[g], c, rates, at)
                        if v > 0.0:
                            low = at
                        else:
                            high = at
                        step = v / steep if steep != 0.0 else math.inf
                        inside = steep < 0.0 and low <= at - step <= high
                        at = at - step if inside else 0.5 * (low + high)
                        if (inside and abs(step) < 1e-9 * h) or high - low < 1e-15 * h:
                            break
                    if at < found:
                        found, fired = at, g
                before[g], slopes[g] = value, slope
        done = found >= left
        stop = end if done else start + found
        while point < grid.shape[0] and (grid[point] < stop or done):
            _state(rest, vec, response, c, rates, grid[point] - start, states[point])
            point += 1
        if done:
            return count
        _state(rest, vec, response, c, rates, found, x)
        angle += w * found
        while angle >= 2.0 * math.pi:
            angle -= 2.0 * math.pi
            turns += 1
        j, after = kinds[fired]
        for k in range(2):
            if mode[k] == 0:
                x[2 * k + 1] = 0.0
        if after == 0:
            x[2 * j + 1] = 0.0
            push = F0 * math.sin(angle) if j == 0 else 0.0
            for i in range(4):
                push += full[2 * j + 1, i] * x[i]
            after = 0 if abs(push) <= limits[j] else (1 if push > 0.0 else -1)
        mode[j] = after
        released = j
        t_out[count] = stop
        what_out[count, 0], what_out[count, 1] = j, after
        for i in range(4):
            x_out[count, i] = x[i]
        count += 1


@numba.njit(cache=True)
def _state(rest: Any, vec: Any, response: Any, c: Any, rates: Any, s: float, out: Any) -> None:
    for i in range(4):
        out[i] = rest[i]
    for q in range(3):
        turned = rates[q] * s
        size = math.exp(turned.real)
        phasor = c[q] * complex(size * math.cos(turned.imag), size * math.sin(turned.imag))
        for i in range(4):
            if q < 2:
                out[i] += 2.0 * (vec[i, q] * phasor).real
            else:
                out[i] += (response[i] * phasor).real


def method() -> Method:
    """The closed form for the scene with two masses."""

    def start(scene: Scene) -> Runs | None:
        if scene.name != "two-masses":
            return None
        p = scene.model.parameter_values()
        full, F0, w = full_matrix(p), p["F0"], p["omega"]
        tables = decomposed(full, F0, w)
        limits = np.array([p["L1"], p["L2"]])
        h = 2 * math.pi / max(w, float(np.max(tables[0].imag))) / _SHARE
        grid, none, nothing = scene.grid, np.empty(0), np.empty((0, 4))

        def run(on_grid: bool) -> Any:
            t, what, x = np.empty(4096), np.empty((4096, 2), dtype=np.int64), np.empty((4096, 4))
            states = np.empty((len(grid), 4)) if on_grid else nothing
            times = grid if on_grid else none
            count = _follow(full, tables, limits, F0, w, h, scene.end, t, what, x, times, states)
            return t[:count], what[:count], x[:count], states if on_grid else None

        def read(outcome: Any) -> Result:
            t, what, x, states = outcome
            return Result(t, what[:, 0], what[:, 1], x, states)

        return Runs(lambda: run(False), lambda: run(True), read)

    return Method("closed-form", "closed form by hand", "limit", start)
