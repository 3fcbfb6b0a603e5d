"""SUNDIALS' CVODE, the Adams method, through scikit-sundae: its own root finding, restarted after each event."""

from __future__ import annotations

from typing import Any

import numpy as np
from sksundae.cvode import CVODE

from rivals.method import Method, Result, Runs, columns
from rivals.physics import Friction
from rivals.scenes import Scene
from rivals.scipy_restart import OFFSET, Rubbing, Striking

_MOST_STEPS = 100_000  # to one output; CVODE's own 500 would not do


def method(rtol: float) -> Method:
    """CVODE at a tolerance; atol is rtol times a thousandth of the states' sizes, as hybridsim's."""

    def start(scene: Scene) -> Runs:
        physics = scene.physics
        rubbing = isinstance(physics, Friction)
        system = Rubbing(physics, OFFSET * scene.velocity) if rubbing else Striking(physics)
        atol = np.array([rtol * 1e-3 * (state.nominal or 1.0) for state in scene.model.states])
        grid, end = scene.grid, scene.end
        solvers: dict[Any, Any] = {}

        def solver(mode: Any) -> Any:
            if mode not in solvers:
                flow, guards = system.piece(mode)

                def rates(t: float, x: Any, out: Any) -> None:
                    out[:] = flow(t, x)

                def events(t: float, x: Any, out: Any) -> None:
                    for k, guard in enumerate(guards):
                        out[k] = guard(t, x)

                events.direction = [-1] * len(guards)
                longest = system.longest(mode, scene)
                solvers[mode] = CVODE(
                    rates,
                    method="Adams",
                    rtol=rtol,
                    atol=atol,
                    max_step=longest if np.isfinite(longest) else 0.0,
                    max_num_steps=_MOST_STEPS,
                    eventsfn=events,
                    num_events=len(guards),
                )
            return solvers[mode]

        def run(on_grid: bool) -> Any:
            t, x, rows, states = 0.0, np.array(physics.x0), [], []
            found = np.empty((len(grid), len(x))) if on_grid else None
            mode, point = system.begin(x), 0
            while True:
                current = solver(mode)
                current.init_step(t, x)
                while True:
                    if found is not None and grid[point] == t:  # the very start of a piece
                        found[point] = x
                        point += 1
                    soln = current.step(end if found is None else grid[point], tstop=end)
                    t, x = float(soln.t), np.array(soln.y, dtype=float)
                    if soln.status == 2:
                        break
                    if found is not None:
                        found[point] = x
                        point += 1
                    if t >= end:
                        return rows, states, found
                fired = int(np.flatnonzero(soln.i_events[-1])[0])
                mode, contact, after = system.follow(mode, fired, t, x)
                rows.append((t, contact, after))
                states.append(x.copy())

        def read(outcome: Any) -> Result:
            rows, states, found = outcome
            return Result(*columns(rows, states, len(physics.x0)), found)

        return Runs(lambda: run(False), lambda: run(True), read)

    return Method(f"cvode@{rtol:.0e}", f"CVODE Adams {rtol:.0e}".replace("e-0", "e-"), "rival", start)
