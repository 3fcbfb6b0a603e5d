"""PathSim: one ODE block, zero-crossing events whose actions set the mode, its Cash-Karp pair."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pathsim import Connection, Simulation
from pathsim.blocks import ODE, Scope
from pathsim.events import ZeroCrossingDown
from pathsim.solvers import RKCK54

from rivals.method import BACKWARD, FORWARD, STICK, STRUCK, Method, Result, Runs, columns
from rivals.physics import Friction
from rivals.scenes import Scene

_NEAR = 1e-10  # of a guard's size: how near an event is located


def method(rtol: float) -> Method:
    """PathSim at a tolerance."""

    def start(scene: Scene) -> Runs:
        make = _rubbing if isinstance(scene.physics, Friction) else _striking
        absolute = rtol * 1e-3 * min(state.nominal or 1.0 for state in scene.model.states)

        def run(on_grid: bool) -> Any:
            rows: list[Any] = []
            states: list[Any] = []
            block, events, longest = make(scene, rows, states)
            scope = Scope(sampling_period=scene.end / (len(scene.grid) - 1)) if on_grid else None
            simulation = Simulation(
                [block, scope] if scope else [block],
                [Connection(block[j], scope[j]) for j in range(len(scene.physics.x0))] if scope else [],
                events,
                dt=scene.period / 100,
                dt_max=longest,
                Solver=RKCK54,
                tolerance_lte_rel=rtol,
                tolerance_lte_abs=absolute,
                log=False,
            )
            simulation.run(scene.end)
            return rows, states, scope.read() if scope else None

        def read(outcome: Any) -> Result:
            rows, states, recorded = outcome
            kept = [i for i, row in enumerate(rows) if row[0] <= scene.end]  # the last step goes beyond
            arrays = columns([rows[i] for i in kept], [states[i] for i in kept], len(scene.physics.x0))
            if recorded is None:
                return Result(*arrays)
            t, values = recorded
            # a time that was hit twice, or lies beyond the end by the last step, is taken once
            place = np.minimum(np.searchsorted(t, scene.grid - 0.25 * scene.grid[1]), len(t) - 1)
            return Result(*arrays, np.asarray(values).T[place])

        return Runs(lambda: run(False), lambda: run(True), read)

    return Method(f"pathsim@{rtol:.0e}", f"PathSim RKCK54 {rtol:.0e}".replace("e-0", "e-"), "rival", start)


def _rubbing(scene: Scene, rows: list[Any], states: list[Any]) -> Any:
    physics = scene.physics
    assert isinstance(physics, Friction)
    n = physics.contacts
    push, slip, belts, masses = physics.push(math), physics.slipping(math), physics.belts, physics.masses
    raised = 2 * _NEAR * scene.velocity

    def settled(j: int, t: float, x: Any) -> int:
        relative = x[2 * j + 1] - belts[j]
        force = push(t, x)[j]
        if relative:
            return FORWARD if relative > 0 else BACKWARD
        return STICK if abs(force) <= physics.limits[j] else FORWARD if force > 0 else BACKWARD

    mode = [settled(j, 0.0, physics.x0) for j in range(n)]

    def rates(state: Any, _: Any, t: float) -> Any:
        x = state.tolist()
        forces = push(t, x)
        friction = slip([s * (x[2 * j + 1] - belts[j]) for j, s in enumerate(mode)])
        found = np.empty(2 * n)
        for j, s in enumerate(mode):
            found[2 * j] = x[2 * j + 1]
            found[2 * j + 1] = (forces[j] - s * friction[j]) / masses[j] if s else 0.0
        return found

    block = ODE(rates, np.array(physics.x0))

    def event(j: int) -> Any:
        size = scene.velocity

        def guard(t: float) -> float:
            x = block.engine.state
            if mode[j]:
                return float(mode[j] * (x[2 * j + 1] - belts[j]) + raised) / size
            return 1.0 - (push(t, x)[j] / physics.limits[j]) ** 2

        def act(t: float) -> None:
            x = block.engine.state.copy()
            held = mode[j] == STICK
            x[2 * j + 1] = belts[j]
            if held:
                mode[j] = FORWARD if push(t, x)[j] > 0 else BACKWARD
            else:
                mode[j] = settled(j, t, x)
            block.engine.set(x)
            rows.append((t, j, mode[j]))
            states.append(x)

        return ZeroCrossingDown(guard, act, tolerance=_NEAR)

    return block, [event(j) for j in range(n)], scene.period / 20


def _striking(scene: Scene, rows: list[Any], states: list[Any]) -> Any:
    physics: Any = scene.physics
    acceleration = physics.acceleration(math)

    def rates(state: Any, _: Any, t: float) -> Any:
        x = state.tolist()
        return np.array((x[1], acceleration(t, x)))

    block = ODE(rates, np.array(physics.x0))

    def act(t: float) -> None:
        x = np.array((physics.wall, -physics.restitution * block.engine.state[1]))
        block.engine.set(x)
        rows.append((t, 0, STRUCK))
        states.append(x)

    guard = ZeroCrossingDown(lambda t: float(physics.wall - block.engine.state[0]), act, tolerance=_NEAR)
    return block, [guard], None
