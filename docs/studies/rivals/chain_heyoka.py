"""The chain of blocks on a belt with heyoka: one compiled Taylor integrator, a terminal event for each block."""

from __future__ import annotations

import time
from collections.abc import Callable

import heyoka as hy
import numpy as np

# Block i has two parameters: the direction of its slip, 0 in stick, and 1 in stick, else 0. A slip starts on its own
# guard, where rounding makes false zeros: the guard is raised by this much, and an event comes late by as much.
_OFFSET = 1e-13


def prepared(
    x0: np.ndarray, coupling: float, leaf: float, delta: float, belt: float, tolerance: float
) -> Callable[[float], tuple[float, int, np.ndarray]]:
    """A function of the end that runs the chain from rest at x0: seconds, events, positions and velocities.

    The limit of stick is 1, and so is the mass of a block; friction is 1/(1 + delta speed).
    """
    n = len(x0)
    x, v = hy.make_vars(*(f"x{i}" for i in range(n))), hy.make_vars(*(f"v{i}" for i in range(n)))
    system, guards, pulls = [], [], []
    for i in range(n):
        beside = [j for j in (i - 1, i + 1) if 0 <= j < n]
        pulls.append(hy.sum([-leaf * x[i], *(coupling * (x[j] - x[i]) for j in beside)]))
        s, held = hy.par[2 * i], hy.par[2 * i + 1]
        sliding = s * (v[i] - belt)
        system += [(x[i], v[i]), (v[i], (1.0 - held) * (pulls[i] - s / (1.0 + delta * sliding)))]
        guards.append((1.0 - held) * (sliding + _OFFSET) + held * (1.0 - pulls[i] * pulls[i]))

    def pull(state: np.ndarray, i: int) -> float:
        force = -leaf * state[2 * i]
        if i > 0:
            force += coupling * (state[2 * i - 2] - state[2 * i])
        if i < n - 1:
            force += coupling * (state[2 * i + 2] - state[2 * i])
        return float(force)

    count = [0]

    def changed(i: int) -> Callable[..., bool]:
        def call(_: object, __: int) -> bool:
            force = pull(state, i)
            if pars[2 * i + 1] == 0.0 and abs(force) <= 1.0:
                state[2 * i + 1] = belt
                pars[2 * i], pars[2 * i + 1] = 0.0, 1.0
            else:
                if pars[2 * i + 1] == 0.0:
                    state[2 * i + 1] = belt
                pars[2 * i], pars[2 * i + 1] = np.sign(force), 0.0
            count[0] += 1
            return True

        return call

    events = [
        hy.t_event(guard, callback=changed(i), direction=hy.event_direction.negative)
        for i, guard in enumerate(guards)
    ]
    integrator = hy.taylor_adaptive(
        system, [0.0] * (2 * n), pars=[0.0] * (2 * n), tol=tolerance, t_events=events, compact_mode=n > 30
    )
    state, pars = integrator.state, integrator.pars

    def run(end: float) -> tuple[float, int, np.ndarray]:
        count[0] = 0
        integrator.time = 0.0
        integrator.reset_cooldowns()
        state[0::2], state[1::2] = x0, 0.0
        pars[0::2], pars[1::2] = -1.0, 0.0
        began = time.perf_counter()
        integrator.propagate_until(end)
        seconds = time.perf_counter() - began
        return seconds, count[0], np.concatenate([state[0::2], state[1::2]])

    return run
