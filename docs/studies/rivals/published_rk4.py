"""The published method, and friction smoothed by tanh: classic RK4 with a fixed step, written by hand in numba."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from rivals.method import Method, Result, Runs
from rivals.physics import Friction
from rivals.scenes import Scene

_EPS_V, _HALVINGS = 8e-4, 16  # of the paper
_MOST_EVENTS = 100_000


def dichotomy(steps: int = 1200, zeroed: bool = True) -> Method:
    """RK4 with a bisection to |v| <= eps_v, where v is set to zero or kept; the force is chosen once a step."""

    def start(scene: Scene) -> Runs | None:
        o = scene.oscillator
        if o is None:
            return None
        return _runs(
            scene, _march_by_dichotomy, (o.m, o.c, o.k, o.limit, o.F0, o.omega), steps, None if zeroed else 1
        )

    velocity = "zeroed" if zeroed else "kept"
    name = "rk4-dichotomy" if zeroed else "rk4-dichotomy-kept"
    return Method(name, f"RK4, dichotomy, v {velocity}, T/{steps}", "published", start, shown=zeroed)


def sign(steps: int = 1200) -> Method:
    """RK4 with the sign of the velocity at every stage, and no stick."""

    def start(scene: Scene) -> Runs | None:
        o = scene.oscillator
        if o is None:
            return None
        return _runs(scene, _march_by_sign, (o.m, o.c, o.k, o.limit, o.F0, o.omega), steps)

    return Method("rk4-sign", f"RK4, sign, T/{steps}", "published", start, shown=False)


def tanh(steps: int = 120_000, width: float = 1e-4) -> Method:
    """RK4 on f = limit tanh(v/width), which has no modes."""

    def start(scene: Scene) -> Runs | None:
        o = scene.oscillator
        if o is None:
            return None
        numbers = (o.m, o.c, o.k, o.limit, o.F0, o.omega, width)
        runs = _runs(scene, _march_smoothed, numbers, steps)
        return Runs(None, runs.grid, runs.read)

    return Method("rk4-tanh", f"RK4, tanh(v/{width:g}), T/{steps}", "published", start, has_modes=False)


def _runs(scene: Scene, march: Any, numbers: Any, steps: int, kept: Any = None) -> Runs:
    assert isinstance(scene.physics, Friction)
    grid, none, nothing = scene.grid, np.empty(0), np.empty((0, 2))
    h = scene.period / steps

    def run(on_grid: bool) -> Any:
        t, after, x = np.empty(_MOST_EVENTS), np.empty(_MOST_EVENTS), np.empty((_MOST_EVENTS, 2))
        states = np.empty((len(grid), 2)) if on_grid else nothing
        count = march(numbers, h, scene.end, t, after, x, grid if on_grid else none, states, kept)
        return t[:count], after[:count], x[:count], states if on_grid else None

    def read(outcome: Any) -> Result:
        t, after, x, states = outcome
        return Result(t, np.zeros(len(t), dtype=int), after.astype(int), x, states)

    return Runs(lambda: run(False), lambda: run(True), read)


@numba.njit(cache=True)
def _accelerated(numbers: Any, t: float, x: float, v: float, mode: float, kept: Any) -> float:
    m, c, k, limit, F0, w = numbers
    if kept is not None:
        e = F0 * math.sin(w * t) - c * v - k * x
        return (e - (e if mode == 0.0 else mode * limit)) / m
    return (F0 * math.sin(w * t) - c * v - k * x - mode * limit) / m


@numba.njit(cache=True)
def _step(
    numbers: Any, t: float, x: float, v: float, mode: float, h: float, kept: Any
) -> tuple[float, float]:
    if kept is None and mode == 0.0:
        return x, 0.0
    a1 = _accelerated(numbers, t, x, v, mode, kept)
    v2 = v + 0.5 * h * a1
    a2 = _accelerated(numbers, t + 0.5 * h, x + 0.5 * h * v, v2, mode, kept)
    v3 = v + 0.5 * h * a2
    a3 = _accelerated(numbers, t + 0.5 * h, x + 0.5 * h * v2, v3, mode, kept)
    v4 = v + h * a3
    a4 = _accelerated(numbers, t + h, x + h * v3, v4, mode, kept)
    return x + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4), v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)


@numba.njit(cache=True)
def _chosen(numbers: Any, t: float, x: float, v: float, kept: Any) -> float:
    _, c, k, limit, F0, w = numbers
    if abs(v) >= _EPS_V:
        return math.copysign(1.0, v)
    e = F0 * math.sin(w * t) - k * x
    if kept is not None:
        e -= c * v
    return 0.0 if abs(e) < limit else math.copysign(1.0, e)


@numba.njit(cache=True)
def _march_by_dichotomy(
    numbers: Any,
    h: float,
    end: float,
    t_out: Any,
    after_out: Any,
    x_out: Any,
    grid: Any,
    states: Any,
    kept: Any,
) -> int:
    t, x, v, count, point = 0.0, 0.0, 0.0, 0, 0
    mode = _chosen(numbers, t, x, v, kept)
    while True:
        chosen = _chosen(numbers, t, x, v, kept)
        if kept is None and chosen == 0.0:
            v = 0.0
        if chosen != mode and count < t_out.shape[0]:
            t_out[count], after_out[count], x_out[count, 0], x_out[count, 1] = t, chosen, x, v
            count += 1
        mode = chosen
        tau = min(h, end - t)
        x1, v1 = _step(numbers, t, x, v, mode, tau, kept)
        if mode != 0.0 and v * v1 < 0.0 and abs(v) >= _EPS_V:
            low, high = 0.0, tau
            for _ in range(_HALVINGS):
                tau = 0.5 * (low + high)
                x1, v1 = _step(numbers, t, x, v, mode, tau, kept)
                if abs(v1) <= _EPS_V:
                    break
                if v * v1 < 0.0:
                    high = tau
                else:
                    low = tau
        while point < grid.shape[0] and (grid[point] < t + tau or t + tau >= end):
            states[point, 0], states[point, 1] = _step(numbers, t, x, v, mode, grid[point] - t, kept)
            point += 1
        if t + tau >= end:
            return count
        t, x, v = t + tau, x1, v1


@numba.njit(cache=True)
def _sign(v: float) -> float:
    return 0.0 if v == 0.0 else math.copysign(1.0, v)


@numba.njit(cache=True)
def _slipping(numbers: Any, t: float, x: float, v: float) -> float:
    m, c, k, limit, F0, w = numbers
    return (F0 * math.sin(w * t) - c * v - k * x - _sign(v) * limit) / m


@numba.njit(cache=True)
def _sign_step(numbers: Any, t: float, x: float, v: float, h: float) -> tuple[float, float]:
    a1 = _slipping(numbers, t, x, v)
    v2 = v + 0.5 * h * a1
    a2 = _slipping(numbers, t + 0.5 * h, x + 0.5 * h * v, v2)
    v3 = v + 0.5 * h * a2
    a3 = _slipping(numbers, t + 0.5 * h, x + 0.5 * h * v2, v3)
    v4 = v + h * a3
    a4 = _slipping(numbers, t + h, x + h * v3, v4)
    return x + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4), v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)


@numba.njit(cache=True)
def _march_by_sign(
    numbers: Any, h: float, end: float, t_out: Any, after_out: Any, x_out: Any, grid: Any, states: Any, _: Any
) -> int:
    t, x, v, count, point, mode = 0.0, 0.0, 0.0, 0, 0, 0.0
    while True:
        tau = min(h, end - t)
        x1, v1 = _sign_step(numbers, t, x, v, tau)
        while point < grid.shape[0] and (grid[point] < t + tau or t + tau >= end):
            states[point, 0], states[point, 1] = _sign_step(numbers, t, x, v, grid[point] - t)
            point += 1
        if t + tau >= end:
            return count
        t, x, v = t + tau, x1, v1
        chosen = _sign(v)
        if chosen != mode and count < t_out.shape[0]:
            t_out[count], after_out[count], x_out[count, 0], x_out[count, 1] = t, chosen, x, v
            count += 1
        mode = chosen


@numba.njit(cache=True)
def _smoothed(numbers: Any, t: float, x: float, v: float) -> float:
    m, c, k, limit, F0, w, width = numbers
    return (F0 * math.sin(w * t) - c * v - k * x - limit * math.tanh(v / width)) / m


@numba.njit(cache=True)
def _march_smoothed(
    numbers: Any, h: float, end: float, t_out: Any, after_out: Any, x_out: Any, grid: Any, states: Any, _: Any
) -> int:
    x, v, point = 0.0, 0.0, 0
    for i in range(round(end / h)):
        t = i * h
        a1 = _smoothed(numbers, t, x, v)
        v2 = v + 0.5 * h * a1
        a2 = _smoothed(numbers, t + 0.5 * h, x + 0.5 * h * v, v2)
        v3 = v + 0.5 * h * a2
        a3 = _smoothed(numbers, t + 0.5 * h, x + 0.5 * h * v2, v3)
        v4 = v + h * a3
        a4 = _smoothed(numbers, t + h, x + h * v3, v4)
        x1 = x + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
        v1 = v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        while point < grid.shape[0] and grid[point] < t + h:
            part = (grid[point] - t) / h
            states[point, 0], states[point, 1] = x + part * (x1 - x), v + part * (v1 - v)
            point += 1
        x, v = x1, v1
    for p in range(point, grid.shape[0]):
        states[p, 0], states[p, 1] = x, v
    return 0
