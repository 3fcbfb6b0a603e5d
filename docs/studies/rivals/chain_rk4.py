"""The chain of blocks on a belt as written in an afternoon: RK4 of fixed step in numba, events by bisection.

After every step each block is looked at for one that stops or is torn loose; the earliest is found by halving the step,
and the whole chain goes on from there.
"""

from __future__ import annotations

import time

import numba
import numpy as np

HALVINGS = 40  # of a step: to rounding
_LOOSE = 1e-14  # off the belt's speed, so that what was torn loose is not stopped again at once


@numba.njit(fastmath=True)
def _pull(x, i, coupling, leaf):
    """Force of the springs on block i."""
    force = -leaf * x[i]
    if i > 0:
        force += coupling * (x[i - 1] - x[i])
    if i < x.shape[0] - 1:
        force += coupling * (x[i + 1] - x[i])
    return force


@numba.njit(fastmath=True)
def _stage(x, v, mode, chain, weight, share, x0, v0, xs, vs, x1, v1):
    """Rates at (x, v): a share of them gives the next stage (xs, vs) from (x0, v0), a weight is added to (x1, v1)."""
    coupling, leaf, delta, belt = chain
    for i in range(x.shape[0]):
        if mode[i] == 0:
            dx, dv = belt, 0.0
        else:
            dx = v[i]
            dv = _pull(x, i, coupling, leaf) - mode[i] / (1.0 + delta * mode[i] * (v[i] - belt))
        x1[i] += weight * dx
        v1[i] += weight * dv
        xs[i] = x0[i] + share * dx
        vs[i] = v0[i] + share * dv


@numba.njit
def _step(x, v, mode, chain, h, a, b, x1, v1):
    """One classical step of length h to (x1, v1)."""
    x1[:] = x
    v1[:] = v
    _stage(x, v, mode, chain, h / 6.0, 0.5 * h, x, v, a[0], a[1], x1, v1)
    _stage(a[0], a[1], mode, chain, h / 3.0, 0.5 * h, x, v, b[0], b[1], x1, v1)
    _stage(b[0], b[1], mode, chain, h / 3.0, h, x, v, a[0], a[1], x1, v1)
    _stage(a[0], a[1], mode, chain, h / 6.0, 0.0, x, v, b[0], b[1], x1, v1)


@numba.njit
def _fired(x, v, mode, chain):
    """The first block that has left its mode, or -1."""
    coupling, leaf, _, belt = chain
    for i in range(x.shape[0]):
        if mode[i] == 0:
            if abs(_pull(x, i, coupling, leaf)) > 1.0:
                return i
        elif mode[i] * (v[i] - belt) < 0.0:
            return i
    return -1


@numba.njit
def _run(x, v, mode, chain, end, step):
    """Run to the end, in place; the number of events."""
    coupling, leaf, _, belt = chain
    n, t, events = x.shape[0], 0.0, 0
    x1, v1, a, b = np.empty(n), np.empty(n), np.empty((2, n)), np.empty((2, n))
    while t < end:
        h = min(step, end - t)
        _step(x, v, mode, chain, h, a, b, x1, v1)
        i = _fired(x1, v1, mode, chain)
        if i >= 0:
            low, high = 0.0, h
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                _step(x, v, mode, chain, middle, a, b, x1, v1)
                if _fired(x1, v1, mode, chain) >= 0:
                    high = middle
                else:
                    low = middle
            h = high
            _step(x, v, mode, chain, h, a, b, x1, v1)
            i, events = _fired(x1, v1, mode, chain), events + 1
            if i >= 0:
                force = _pull(x1, i, coupling, leaf)
                v1[i] = belt
                if mode[i] == 0 or abs(force) > 1.0:
                    mode[i] = 1 if force > 0.0 else -1
                    v1[i] += mode[i] * _LOOSE
                else:
                    mode[i] = 0
        x[:] = x1
        v[:] = v1
        t += h
    return events


def run(
    x0: np.ndarray, chain: tuple[float, float, float, float], end: float, step: float
) -> tuple[float, int, np.ndarray]:
    """The chain (coupling, leaf, delta, belt) from rest at x0: seconds, events, positions and velocities at the end."""
    x, v, mode = x0.copy(), np.zeros(len(x0)), np.full(len(x0), -1, dtype=np.int64)
    began = time.perf_counter()
    events = _run(x, v, mode, chain, end, step)
    return time.perf_counter() - began, events, np.concatenate([x, v])
