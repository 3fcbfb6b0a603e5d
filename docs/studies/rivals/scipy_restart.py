"""SciPy's DOP853 with terminal events, restarted after each: what most users do today."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from rivals.method import BACKWARD, FORWARD, STICK, STRUCK, Method, Result, Runs, columns
from rivals.physics import Friction
from rivals.scenes import Scene

Piece = tuple[Callable[[float, Any], Any], list[Any], Callable[[int, float, Any], tuple[int, int]]]

# A slip starts with v = v' = 0 on its own guard, and rounding may take it to the wrong side. So the guard is raised by
# this much of a velocity's size. Without it P1 loses fourteen events.
OFFSET = 1e-13


def method(rtol: float, shown: bool = True) -> Method:
    """The loop at a tolerance; atol is rtol times a thousandth of the states' sizes, as hybridsim's."""

    def start(scene: Scene) -> Runs:
        physics = scene.physics
        rubbing = isinstance(physics, Friction)
        system = Rubbing(physics, OFFSET * scene.velocity) if rubbing else Striking(physics)
        atol = [rtol * 1e-3 * (state.nominal or 1.0) for state in scene.model.states]
        grid = scene.grid

        def run(on_grid: bool) -> Any:
            t, x, rows, states = 0.0, np.array(scene.physics.x0), [], []
            found = np.empty((len(x), len(grid))) if on_grid else None
            done, mode = 0, system.begin(x)
            while True:
                flow, guards = system.piece(mode)
                sol = solve_ivp(
                    flow,
                    (t, scene.end),
                    x,
                    method="DOP853",
                    rtol=rtol,
                    atol=atol,
                    max_step=system.longest(mode, scene),
                    events=guards,
                    dense_output=on_grid,
                )
                t, x = float(sol.t[-1]), sol.y[:, -1].copy()
                if found is not None:
                    upto = np.searchsorted(grid, t, side="left") if sol.status == 1 else len(grid)
                    if upto > done:
                        found[:, done:upto] = sol.sol(grid[done:upto])
                    done = upto
                if sol.status != 1:
                    return rows, states, found
                fired = min(k for k, times in enumerate(sol.t_events) if len(times))
                mode, contact, after = system.follow(mode, fired, t, x)
                rows.append((t, contact, after))
                states.append(x.copy())

        def read(outcome: Any) -> Result:
            rows, states, found = outcome
            arrays = columns(rows, states, len(scene.physics.x0))
            return Result(*arrays, None if found is None else found.T)

        return Runs(lambda: run(False), lambda: run(True), read)

    return Method(
        f"scipy@{rtol:.0e}", f"SciPy DOP853 {rtol:.0e}".replace("e-0", "e-"), "rival", start, shown=shown
    )


def _terminal(guard: Callable[[float, Any], float]) -> Any:
    guard.terminal, guard.direction = True, -1.0
    return guard


class Rubbing:
    """Masses that rub, mode by mode: tuples of signs, 0 for stick."""

    def __init__(self, physics: Friction, raised: float) -> None:
        self.raised = raised
        self.physics, self.push, self.slip = physics, physics.push(math), physics.slipping(math)
        self.pieces: dict[tuple[int, ...], tuple[Any, list[Any], list[tuple[int, int]]]] = {}

    def longest(self, mode: tuple[int, ...], scene: Scene) -> float:
        """A step: where a body is held nothing else bounds it, and the whole stick would be stepped over."""
        return math.inf if all(mode) else scene.period / 20

    def begin(self, x: np.ndarray) -> tuple[int, ...]:
        return tuple(self._settled(j, 0.0, x) for j in range(self.physics.contacts))

    def _settled(self, j: int, t: float, x: np.ndarray) -> int:
        relative = x[2 * j + 1] - self.physics.belts[j]
        if relative:
            return FORWARD if relative > 0 else BACKWARD
        force = self.push(t, x)[j]
        return STICK if abs(force) <= self.physics.limits[j] else FORWARD if force > 0 else BACKWARD

    def piece(self, mode: tuple[int, ...]) -> tuple[Any, list[Any]]:
        if mode not in self.pieces:
            self.pieces[mode] = self._make(mode)
        return self.pieces[mode][:2]

    def _make(self, mode: tuple[int, ...]) -> tuple[Any, list[Any], list[tuple[int, int]]]:
        physics, push, slip = self.physics, self.push, self.slip
        contacts = range(physics.contacts)

        flow = (
            _one_contact(physics, push, slip, mode[0])
            if len(mode) == 1
            else _several(physics, push, slip, mode)
        )
        guards, meaning = [], []
        for j in contacts:
            if mode[j]:
                guards.append(
                    _terminal(lambda t, x, j=j: mode[j] * (x[2 * j + 1] - physics.belts[j]) + self.raised)
                )
                meaning.append((j, 0))
            else:
                for s in (FORWARD, BACKWARD):
                    guards.append(_terminal(lambda t, x, j=j, s=s: physics.limits[j] - s * push(t, x)[j]))
                    meaning.append((j, s))
        return flow, guards, meaning

    def follow(
        self, mode: tuple[int, ...], fired: int, t: float, x: np.ndarray
    ) -> tuple[tuple[int, ...], int, int]:
        j, after = self.pieces[mode][2][fired]
        if not after:
            x[2 * j + 1] = self.physics.belts[j]
            after = self._settled(j, t, x)
        return (*mode[:j], after, *mode[j + 1 :]), j, after


def _one_contact(physics: Friction, push: Any, slip: Any, s: int) -> Any:
    """Rates of one mass, without loops: they are called by the ten thousand."""
    mass, belt = physics.masses[0], physics.belts[0]

    def slipping(t: float, state: Any) -> tuple[float, float]:
        x, v = state.tolist()
        return v, (push(t, (x, v))[0] - s * slip((s * (v - belt),))[0]) / mass

    def stuck(t: float, state: Any) -> tuple[float, float]:
        return state[1], 0.0

    return slipping if s else stuck


def _several(physics: Friction, push: Any, slip: Any, mode: tuple[int, ...]) -> Any:
    def flow(t: float, state: Any) -> list[float]:
        x = state.tolist()
        forces = push(t, x)
        friction = slip([s * (x[2 * j + 1] - physics.belts[j]) for j, s in enumerate(mode)])
        rates = []
        for j, s in enumerate(mode):
            rates += [x[2 * j + 1], (forces[j] - s * friction[j]) / physics.masses[j] if s else 0.0]
        return rates

    return flow


class Striking:
    """The mass that strikes a wall, in its one mode."""

    def __init__(self, physics: Any) -> None:
        self.physics = physics
        acceleration, wall = physics.acceleration(math), physics.wall

        def flow(t: float, x: Any) -> tuple[float, float]:
            x = x.tolist()
            return x[1], acceleration(t, x)

        self.both = flow, [_terminal(lambda t, x: wall - x[0])]

    def longest(self, mode: int, scene: Scene) -> float:
        return math.inf

    def begin(self, x: np.ndarray) -> int:
        return 0

    def piece(self, mode: int) -> tuple[Any, list[Any]]:
        return self.both

    def follow(self, mode: int, fired: int, t: float, x: np.ndarray) -> tuple[int, int, int]:
        x[0], x[1] = self.physics.wall, -self.physics.restitution * x[1]
        return mode, 0, STRUCK
