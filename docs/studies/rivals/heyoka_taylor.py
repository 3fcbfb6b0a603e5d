"""heyoka: one compiled Taylor integrator whose parameters are the mode, terminal events with callbacks."""

from __future__ import annotations

import math
from typing import Any

import heyoka as hy
import numpy as np

from rivals.method import BACKWARD, FORWARD, STICK, STRUCK, Method, Result, Runs, columns
from rivals.physics import Friction, Impact
from rivals.scenes import Scene

# A slip starts with v = v' = 0 on its own guard, where rounding makes false zeros. So the guard is raised by this much
# of a velocity's size; an event comes late by as much.
_OFFSET = 1e-13


def method(tolerance: float, offset: float = _OFFSET, shown: bool = True) -> Method:
    """heyoka at a tolerance."""

    def start(scene: Scene) -> Runs:
        rows: list[tuple[float, int, int]] = []
        states: list[Any] = []
        make = _rubbing if isinstance(scene.physics, Friction) else _striking
        integrator, begin = make(scene, tolerance, offset, rows, states)
        grid = scene.grid

        def events() -> Any:
            begin()
            integrator.propagate_until(scene.end)
            return list(rows), list(states), None

        def on_grid() -> Any:
            begin()
            values = integrator.propagate_grid(grid)[-1]
            return list(rows), list(states), values

        def read(outcome: Any) -> Result:
            found, points, values = outcome
            return Result(*columns(found, points, len(scene.physics.x0)), values)

        return Runs(events, on_grid, read)

    return Method(f"heyoka@{tolerance:.0e}", f"heyoka {tolerance:.0e}", "rival", start, shown=shown)


def _rubbing(scene: Scene, tolerance: float, offset: float, rows: list[Any], states: list[Any]) -> Any:
    """Per contact two parameters: the sign of the slip s (0 in stick), and 1 in stick, else 0."""
    physics = scene.physics
    assert isinstance(physics, Friction)
    n = physics.contacts
    x = hy.make_vars(*(f"{kind}{j}" for j in range(n) for kind in "xv"))
    s, held = [hy.par[2 * j] for j in range(n)], [hy.par[2 * j + 1] for j in range(n)]
    forces = physics.push(hy)(hy.time, x)
    relative = [x[2 * j + 1] - physics.belts[j] for j in range(n)]
    friction = physics.slipping(hy)([s[j] * relative[j] for j in range(n)])
    system, guards = [], []
    raised = offset * scene.velocity
    for j in range(n):
        slide = (forces[j] - s[j] * friction[j]) * ((1.0 - held[j]) / physics.masses[j])
        system += [(x[2 * j], x[2 * j + 1]), (x[2 * j + 1], slide)]
        limit = physics.limits[j]
        stuck = 1.0 - (forces[j] / limit) * (forces[j] / limit)
        guards.append(s[j] * relative[j] + raised + held[j] * (stuck - raised))

    def callback(j: int) -> Any:
        v, limit, belt = 2 * j + 1, physics.limits[j], physics.belts[j]
        plain = physics.push(math)

        def call(ta: Any, _: int) -> bool:
            t, x = ta.time, state.tolist()  # floats of Python are faster than those of NumPy
            if modes[j]:
                state[v] = x[v] = belt
                force = plain(t, x)[j]
                after = STICK if abs(force) <= limit else FORWARD if force > 0 else BACKWARD
            else:
                after = FORWARD if plain(t, x)[j] > 0 else BACKWARD
            modes[j] = pars[2 * j] = after
            pars[2 * j + 1] = after == 0
            rows.append((t, j, after))
            states.append(x)
            return True

        return call

    events = [
        hy.t_event(guard, callback=callback(j), direction=hy.event_direction.negative)
        for j, guard in enumerate(guards)
    ]
    integrator = hy.taylor_adaptive(
        system, list(physics.x0), pars=[0.0] * (2 * n), tol=tolerance, fast_math=True, t_events=events
    )
    state, pars = integrator.state, integrator.pars
    modes = [0] * n
    first = []
    for j, force in enumerate(physics.push(math)(0.0, physics.x0)):
        moving = physics.x0[2 * j + 1] - physics.belts[j]
        sign = int(np.sign(moving or (force if abs(force) > physics.limits[j] else 0.0)))
        first += [sign, sign == 0]

    def begin() -> None:
        rows.clear()
        states.clear()
        integrator.time = 0.0
        integrator.reset_cooldowns()
        state[:] = physics.x0
        pars[:] = first
        modes[:] = first[::2]

    return integrator, begin


def _striking(scene: Scene, tolerance: float, offset: float, rows: list[Any], states: list[Any]) -> Any:
    physics = scene.physics
    assert isinstance(physics, Impact)
    x, v = hy.make_vars("x", "v")
    system = [(x, v), (v, physics.acceleration(hy)(hy.time, (x, v)))]

    def call(ta: Any, _: int) -> bool:
        state[0] = physics.wall
        state[1] *= -physics.restitution
        rows.append((ta.time, 0, STRUCK))
        states.append(state.tolist())
        return True

    event = hy.t_event(physics.wall - x, callback=call, direction=hy.event_direction.negative)
    integrator = hy.taylor_adaptive(system, list(physics.x0), tol=tolerance, fast_math=True, t_events=[event])
    state = integrator.state

    def begin() -> None:
        rows.clear()
        states.clear()
        integrator.time = 0.0
        integrator.reset_cooldowns()
        state[:] = physics.x0

    return integrator, begin
