"""CasADi: its explicit Runge-Kutta integrator with zero crossings and a transition, one call for a whole run."""

from __future__ import annotations

import shutil
from typing import Any

import casadi as ca
import numpy as np

from rivals.method import STRUCK, Method, Result, Runs
from rivals.physics import Friction
from rivals.scenes import Scene

# The integrator tells of its events by the state alone. So the transition writes each one into one of this many slots,
# states without rates, and every point of the output grid shows the latest.
_SLOTS = 2
_SPARSE = 701  # points that are enough for this where no states are asked for
# A slip starts with v = v' = 0 on its own guard, which is raised by this much of a velocity's size.
_OFFSET = 1e-12


def method(rtol: float) -> Method:
    """CasADi at a tolerance."""

    def start(scene: Scene) -> Runs:
        n = len(scene.physics.x0)
        make = _rubbing if isinstance(scene.physics, Friction) else _striking
        x, modes, rates, guards, follow, first, held = make(scene)
        size = n + 3  # time, contact, what follows, states
        slots, count = ca.SX.sym("slots", size, _SLOTS), ca.SX.sym("count")
        whole = ca.vertcat(x, modes, ca.vec(slots), count)
        time, index = ca.SX.sym("t"), ca.SX.sym("index")
        dae = {"x": whole, "t": time, "zero": guards(time)}
        dae["ode"] = ca.vertcat(ca.vertcat(*rates(time)), ca.SX.zeros(whole.numel() - n))
        after_x, after_modes, contact, after = follow(index, time)
        event = ca.vertcat(time, contact, after, after_x)
        here = ca.fmod(count, _SLOTS)
        written = ca.horzcat(*(ca.if_else(here == k, event, slots[:, k]) for k in range(_SLOTS)))
        post = ca.vertcat(after_x, after_modes, ca.vec(written), count + 1)
        empty = [ca.SX(0, 0)] * 3
        transition = ca.Function(
            "transition",
            [index, time, whole, *empty],
            [post, ca.SX(0, 1)],
            ["index", "t", "x", "z", "p", "u"],
            ["post_x", "post_z"],
        )
        nominal = [state.nominal or 1.0 for state in scene.model.states]
        options = {
            "transition": transition,
            "reltol": rtol,
            "abstol": rtol * 1e-3 * min(nominal),
            "max_events": 100_000,
            **_compiled(),
            "max_event_iter": 50,
            **({"max_step_size": scene.period / 20} if held else {}),
        }
        begin = np.concatenate([scene.physics.x0, first, np.zeros(size * _SLOTS + 1)])
        dense, sparse = (
            ca.integrator("run", "erk", dae, 0.0, list(points[1:]), options)
            for points in (scene.grid, np.linspace(0.0, scene.end, _SPARSE))
        )

        def read(outcome: Any) -> Result:
            states = np.column_stack([begin, outcome])
            counts = states[-1].astype(int)
            found = []
            at = n + len(first)
            for i in range(1, len(counts)):
                for k in range(max(counts[i - 1], counts[i] - _SLOTS), counts[i]):
                    place = at + (k % _SLOTS) * size
                    found.append(states[place : place + size, i])
            rows = np.array(found).reshape(-1, size)
            grid = states[:n].T if len(counts) == len(scene.grid) else None
            return Result(rows[:, 0], rows[:, 1].astype(int), rows[:, 2].astype(int), rows[:, 3:], grid)

        return Runs(
            lambda: sparse(x0=begin)["xf"].full(),
            lambda: dense(x0=begin)["xf"].full(),
            read,
        )

    return Method(f"casadi@{rtol:.0e}", f"CasADi erk {rtol:.0e}".replace("e-0", "e-"), "rival", start)


def _compiled() -> dict[str, Any]:
    """Options that have a C compiler make the functions, where there is one: almost twenty times as fast."""
    if not any(shutil.which(name) for name in ("gcc", "cc", "clang")):
        return {}
    return {"jit": True, "compiler": "shell", "jit_options": {"flags": ["-O3"]}}


def _rubbing(scene: Scene) -> Any:
    physics = scene.physics
    assert isinstance(physics, Friction)
    n = physics.contacts
    x, s = ca.SX.sym("x", 2 * n), ca.SX.sym("s", n)
    push, slip = physics.push(ca), physics.slipping(ca)
    relative = [x[2 * j + 1] - physics.belts[j] for j in range(n)]
    raised = _OFFSET * scene.velocity

    def rates(t: Any) -> list[Any]:
        forces, friction = push(t, x), slip([s[j] * relative[j] for j in range(n)])
        found = []
        for j in range(n):
            slide = (forces[j] - s[j] * friction[j]) / physics.masses[j]
            found += [x[2 * j + 1], ca.if_else(s[j] == 0, 0.0, slide)]
        return found

    def guards(t: Any) -> Any:
        forces = push(t, x)
        return ca.vertcat(
            *(
                ca.if_else(s[j] == 0, 1.0 - (forces[j] / physics.limits[j]) ** 2, s[j] * relative[j] + raised)
                for j in range(n)
            )
        )

    def settled(force: Any, limit: float) -> Any:
        return ca.if_else(ca.fabs(force) <= limit, 0.0, ca.sign(force))

    def follow(index: Any, t: Any) -> tuple[Any, ...]:
        states, modes, after = [], [], 0.0
        for j in range(n):
            mine, held = index == j, s[j] == 0
            stopped = ca.if_else(mine, physics.belts[j], x[2 * j + 1])
            states += [x[2 * j], stopped]
        force = push(t, ca.vertcat(*states))
        for j in range(n):
            mine, held = index == j, s[j] == 0
            new = ca.if_else(held, ca.sign(force[j]), settled(force[j], physics.limits[j]))
            modes.append(ca.if_else(mine, new, s[j]))
            after = ca.if_else(mine, new, after)
        return ca.vertcat(*states), ca.vertcat(*modes), index, after

    x0 = ca.DM(physics.x0)
    first = []
    for j, force in enumerate(physics.push(ca)(0.0, x0)):
        moving = physics.x0[2 * j + 1] - physics.belts[j]
        pushed = float(force)
        first.append(float(np.sign(moving or (pushed if abs(pushed) > physics.limits[j] else 0.0))))
    return x, s, rates, guards, follow, first, True


def _striking(scene: Scene) -> Any:
    physics: Any = scene.physics
    x, s = ca.SX.sym("x", 2), ca.SX.sym("s", 0)
    acceleration = physics.acceleration(ca)

    def rates(t: Any) -> list[Any]:
        return [x[1], acceleration(t, x)]

    def guards(t: Any) -> Any:
        return physics.wall - x[0]

    def follow(index: Any, t: Any) -> tuple[Any, ...]:
        return ca.vertcat(physics.wall, -physics.restitution * x[1]), s, index, STRUCK

    return x, s, rates, guards, follow, [], False
