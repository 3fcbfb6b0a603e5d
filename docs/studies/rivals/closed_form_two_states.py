"""The limit: the oscillator's closed form, written by hand in numba for this one system.

A slip is marched on an even grid by turning its two phasors, so that a grid point costs no sine; a change of sign, or a
dip between two points, is followed by Newton's method on the closed form. A stick ends at an arcsine.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from rivals.method import Method, Result, Runs
from rivals.scenes import Scene

_SHARE = 8  # grid points in the shorter of the two periods: the velocity bends but once between two


@numba.njit(cache=True)
def _follow(numbers: Any, end: float, t_out: Any, after_out: Any, x_out: Any, grid: Any, states: Any) -> int:
    """Events into t_out, after_out, x_out; states on the grid; gives the number of events."""
    m, c, k, limit, F0, w = numbers
    d = c / (2.0 * m)
    wn2 = k / m
    wd = math.sqrt(wn2 - d * d)
    # the forced response is a sin(w t) + b cos(w t)
    real, imag = wn2 - w * w, 2.0 * d * w
    size = F0 / m / (real * real + imag * imag)
    a, b = size * real, -size * imag
    shift = limit / k
    h = 2.0 * math.pi / max(w, wd) / _SHARE
    decay_h = math.exp(-d * h)
    cd_h, sd_h = decay_h * math.cos(wd * h), decay_h * math.sin(wd * h)
    cw_h, sw_h = math.cos(w * h), math.sin(w * h)
    turn = 2.0 * math.pi
    count, point = 0, 0
    # time is turns * period + angle / w
    turns, angle = 0, 0.0
    period = turn / w
    x, sign = 0.0, 0.0
    while True:
        start = turns * period + angle / w
        if sign == 0.0:
            # |F0 sin(angle) - k x| reaches the limit
            up, low = (limit + k * x) / F0, (k * x - limit) / F0
            first, sign = math.inf, 0.0
            if up < 1.0:
                gap = math.asin(up) - angle
                if gap < 0.0:
                    gap += turn
                first, sign = gap, 1.0
            if low > -1.0:
                gap = math.pi - math.asin(low) - angle
                while gap >= turn:
                    gap -= turn
                if gap < 0.0:
                    gap += turn
                if gap < first:
                    first, sign = gap, -1.0
            done = start + first / w >= end
            stop = end if done else start + first / w
            while point < grid.shape[0] and (grid[point] < stop or done):
                states[point, 0] = x
                states[point, 1] = 0.0
                point += 1
            if done:
                return count
            angle += first
            if angle >= turn:
                angle -= turn
                turns += 1
            t_out[count] = stop
            after_out[count] = sign
            x_out[count, 0] = x
            x_out[count, 1] = 0.0
            count += 1
            continue
        # slip: x = sign part + forced + exp(-d s) (p cos(wd s) + q sin(wd s))
        centre = -sign * shift
        sa, ca = math.sin(angle), math.cos(angle)
        p = x - centre - (a * sa + b * ca)
        q = (d * p - w * (a * ca - b * sa)) / wd
        # the velocity: exp(-d s) (vp cos + vq sin) + w (a cos(angle + w s) - b sin(angle + w s))
        vp, vq = wd * q - d * p, -wd * p - d * q
        # its slope: exp(-d s) (ap cos + aq sin) - w^2 (a sin + b cos)
        ap, aq = wd * vq - d * vp, -wd * vp - d * vq
        s, v, slope = 0.0, 0.0, 0.0
        cd, sd, cw, sw = 1.0, 0.0, ca, sa
        left = end - start
        lo, hi, guess = 0.0, math.inf, 0.0
        v_before = 0.0
        slope_before = sign * (ap - w * w * (a * sa + b * ca))
        while True:
            s += h
            cd, sd = cd * cd_h - sd * sd_h, sd * cd_h + cd * sd_h
            cw, sw = cw * cw_h - sw * sw_h, sw * cw_h + cw * sw_h
            v = sign * (vp * cd + vq * sd + w * (a * cw - b * sw))
            slope = sign * (ap * cd + aq * sd - w * w * (a * sw + b * cw))
            if v <= 0.0:
                lo, hi = s - h, s
                # the zero of the cubic's secant, leaning to the steeper end
                guess = s + (-v / slope if slope < 0.0 else 0.0)
                break
            if v_before > 0.0 and slope_before < 0.0 and slope > 0.0:
                # a dip: where is its bottom?
                dip = s - h * slope / (slope - slope_before)
                for _ in range(3):
                    decay = math.exp(-d * dip)
                    c1, s1 = decay * math.cos(wd * dip), decay * math.sin(wd * dip)
                    c2, s2 = math.cos(angle + w * dip), math.sin(angle + w * dip)
                    bend = ap * c1 + aq * s1 - w * w * (a * s2 + b * c2)
                    jerk = (wd * aq - d * ap) * c1 + (-wd * ap - d * aq) * s1 - w * w * w * (a * c2 - b * s2)
                    dip -= bend / jerk
                decay = math.exp(-d * dip)
                bottom = sign * (
                    decay * (vp * math.cos(wd * dip) + vq * math.sin(wd * dip))
                    + w * (a * math.cos(angle + w * dip) - b * math.sin(angle + w * dip))
                )
                if bottom <= 0.0:
                    lo, hi = s - h, dip
                    guess = 0.5 * (lo + hi)
                    break
            if s > left:
                break
            v_before, slope_before = v, slope
        found = math.inf
        if hi < math.inf:
            if not lo < guess < hi:
                guess = 0.5 * (lo + hi)
            found = guess
            for _ in range(60):
                decay = math.exp(-d * found)
                c1, s1 = decay * math.cos(wd * found), decay * math.sin(wd * found)
                phase = angle + w * found
                c2, s2 = math.cos(phase), math.sin(phase)
                v = sign * (vp * c1 + vq * s1 + w * (a * c2 - b * s2))
                slope = sign * (ap * c1 + aq * s1 - w * w * (a * s2 + b * c2))
                if v > 0.0:
                    lo = found
                else:
                    hi = found
                step = v / slope
                if slope < 0.0 and lo <= found - step <= hi:
                    found -= step
                    # quadratic: what comes after a step this small is below rounding
                    if abs(step) < 1e-9 * h:
                        break
                else:
                    found = 0.5 * (lo + hi)
        done = found >= left
        stop = end if done else start + found
        while point < grid.shape[0] and (grid[point] < stop or done):
            s = grid[point] - start
            decay = math.exp(-d * s)
            c1, s1 = decay * math.cos(wd * s), decay * math.sin(wd * s)
            c2, s2 = math.cos(angle + w * s), math.sin(angle + w * s)
            states[point, 0] = centre + p * c1 + q * s1 + a * s2 + b * c2
            states[point, 1] = vp * c1 + vq * s1 + w * (a * c2 - b * s2)
            point += 1
        if done:
            return count
        decay = math.exp(-d * found)
        c1, s1 = decay * math.cos(wd * found), decay * math.sin(wd * found)
        angle += w * found
        sa, ca = math.sin(angle), math.cos(angle)
        x = centre + p * c1 + q * s1 + a * sa + b * ca
        while angle >= turn:
            angle -= turn
            turns += 1
        e = F0 * sa - k * x
        sign = 0.0 if abs(e) <= limit else math.copysign(1.0, e)
        t_out[count] = stop
        after_out[count] = sign
        x_out[count, 0] = x
        x_out[count, 1] = 0.0
        count += 1


def method() -> Method:
    """The closed form for the oscillator with Coulomb friction."""

    def start(scene: Scene) -> Runs | None:
        o = scene.oscillator
        if o is None:
            return None
        numbers = (o.m, o.c, o.k, o.limit, o.F0, o.omega)
        grid, none, nothing = scene.grid, np.empty(0), np.empty((0, 2))

        def run(on_grid: bool) -> Any:
            t, after, x = np.empty(4096), np.empty(4096), np.empty((4096, 2))
            states = np.empty((len(grid), 2)) if on_grid else nothing
            count = _follow(numbers, scene.end, t, after, x, grid if on_grid else none, states)
            return t[:count], after[:count], x[:count], states if on_grid else None

        def read(outcome: Any) -> Result:
            t, after, x, states = outcome
            return Result(t, np.zeros(len(t), dtype=int), after.astype(int), x, states)

        return Runs(lambda: run(False), lambda: run(True), read)

    return Method("closed-form", "closed form by hand", "limit", start)
