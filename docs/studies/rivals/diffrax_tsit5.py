"""diffrax: Tsit5 with its own events, the loop over the smooth pieces inside one compiled function."""

from __future__ import annotations

from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import optimistix

from rivals.method import STRUCK, Method, Result, Runs
from rivals.physics import Friction, Impact
from rivals.scenes import Scene

jax.config.update("jax_enable_x64", True)

_MOST_EVENTS = 2048
_WINDOW = 192  # grid points that one piece can have
# A slip starts with v = v' = 0 on its own guard; raised by this much of a velocity's size times the tolerance it has no
# zero there.
_OFFSET = 1e-3


def method(rtol: float) -> Method:
    """diffrax at a tolerance; atol is rtol times a thousandth of the states' sizes, as hybridsim's."""

    def start(scene: Scene) -> Runs:
        atol = jnp.array([rtol * 1e-3 * (state.nominal or 1.0) for state in scene.model.states])
        pieces = _rubbing if isinstance(scene.physics, Friction) else _striking
        parts = pieces(scene, _OFFSET * rtol * scene.velocity)
        alone, on_grid = (jax.jit(_whole(scene, parts, rtol, atol, grid)) for grid in (False, True))

        def read(outcome: Any) -> Result:
            count, t, contact, after, x, states = map(np.asarray, outcome)
            none = states.shape[0] < len(scene.grid)
            return Result(
                t[:count],
                contact[:count],
                after[:count],
                x[:count],
                None if none else states[: len(scene.grid)],
            )

        return Runs(lambda: jax.block_until_ready(alone()), lambda: jax.block_until_ready(on_grid()), read)

    label = f"diffrax Tsit5 {rtol:.0e}".replace("e-0", "e-")
    return Method(f"diffrax@{rtol:.0e}", label, "rival", start, has_threads=True)


def _whole(scene: Scene, parts: Any, rtol: float, atol: Any, with_grid: bool) -> Any:
    """The run as a function to be compiled: of nothing, since the scene is known."""
    flow, guards, follow, first, slowly = parts
    n, end = len(scene.physics.x0), scene.end
    # padded, so that a window never has too few
    grid = jnp.concatenate([jnp.asarray(scene.grid), jnp.full(_WINDOW, end)])
    term, solver = diffrax.ODETerm(flow), diffrax.Tsit5()
    one = len(guards) == 1
    finder = (optimistix.Bisection if one else optimistix.Newton)(1e-12, 1e-12)  # bisection takes one only
    event = diffrax.Event(
        guards[0] if one else guards, finder, direction=False if one else [False] * len(guards)
    )

    def piece(t: Any, x: Any, mode: Any, point: Any) -> Any:
        controller = diffrax.PIDController(rtol, atol, dtmax=slowly(mode))
        at_end = diffrax.SubSaveAt(t1=True)
        subs = [at_end]
        if with_grid:
            window = jax.lax.dynamic_slice(grid, (point,), (_WINDOW,))
            subs.append(diffrax.SubSaveAt(ts=window))
        return diffrax.diffeqsolve(
            term,
            solver,
            t,
            end,
            scene.period / 40,
            x,
            mode,
            saveat=diffrax.SaveAt(subs=subs),
            stepsize_controller=controller,
            event=event,
            adjoint=diffrax.ForwardMode(),
            max_steps=None,
            throw=False,
        )

    def body(carry: Any) -> Any:
        t, x, mode, point, count, times, contacts, afters, xs, states, _ = carry
        sol = piece(t, x, mode, point)
        fired = jnp.stack(jax.tree_util.tree_leaves(sol.event_mask))
        going = fired.any()
        t, x = sol.ts[0][0], sol.ys[0][0]
        if with_grid:
            states = jax.lax.dynamic_update_slice(states, sol.ys[1], (point, jnp.zeros_like(point)))
            point = jnp.searchsorted(grid, t, side="left").astype(point.dtype)
        x, mode, contact, after = follow(t, x, mode, jnp.argmax(fired))
        # what comes after the end is written where the next event would be, and not counted
        times, contacts, afters = (
            times.at[count].set(t),
            contacts.at[count].set(contact),
            afters.at[count].set(after),
        )
        xs = xs.at[count].set(x)
        return t, x, mode, point, count + going, times, contacts, afters, xs, states, going

    def run() -> Any:
        empty = jnp.zeros(_MOST_EVENTS)
        carry = (
            jnp.asarray(0.0),
            jnp.asarray(scene.physics.x0),
            first,
            jnp.asarray(0),
            jnp.asarray(0),
            empty,
            empty.astype(int),
            empty.astype(int),
            jnp.zeros((_MOST_EVENTS, n)),
            jnp.zeros((len(grid) if with_grid else 0, n)),
            jnp.asarray(True),
        )
        carry = jax.lax.while_loop(lambda c: c[-1] & (c[4] < _MOST_EVENTS), body, carry)
        return carry[4], carry[5], carry[6], carry[7], carry[8], carry[9]

    return run


def _rubbing(scene: Scene, raised: float) -> Any:
    physics = scene.physics
    assert isinstance(physics, Friction)
    n = physics.contacts
    push, slip = physics.push(jnp), physics.slipping(jnp)
    masses, belts, limits = (jnp.array(row) for row in (physics.masses, physics.belts, physics.limits))

    def flow(t: Any, x: Any, s: Any) -> Any:
        forces = jnp.stack(push(t, x))
        friction = jnp.stack([jnp.asarray(f) for f in slip(s * (x[1::2] - belts))])
        rates = jnp.where(s == 0, 0.0, (forces - s * friction) / masses)
        return jnp.stack([x[1::2], rates], axis=1).ravel()

    def guard(j: int) -> Any:
        def value(t: Any, y: Any, args: Any, **_: Any) -> Any:
            s = args[j]
            stuck = 1.0 - (push(t, y)[j] / limits[j]) ** 2
            return jnp.where(s == 0, stuck, s * (y[2 * j + 1] - belts[j]) + raised)

        return value

    def settled(t: Any, x: Any) -> Any:
        forces = jnp.stack(push(t, x))
        return jnp.where(jnp.abs(forces) <= limits, 0.0, jnp.sign(forces))

    def follow(t: Any, x: Any, s: Any, j: Any) -> Any:
        held = s[j] == 0
        x = x.at[2 * j + 1].set(belts[j])
        after = jnp.where(held, jnp.sign(jnp.stack(push(t, x))[j]), settled(t, x)[j])
        return x, s.at[j].set(after), j, after.astype(int)

    x0 = jnp.asarray(physics.x0)
    moving = x0[1::2] - belts
    first = jnp.where(moving == 0, settled(0.0, x0), jnp.sign(moving))
    # a body that is held does not bound the step, and its release would be stepped over
    return (
        flow,
        [guard(j) for j in range(n)],
        follow,
        first,
        lambda s: jnp.where((s == 0).any(), scene.period / 20, jnp.inf),
    )


def _striking(scene: Scene, raised: float) -> Any:
    physics = scene.physics
    assert isinstance(physics, Impact)
    acceleration, wall = physics.acceleration(jnp), physics.wall

    def flow(t: Any, x: Any, _: Any) -> Any:
        return jnp.stack([x[1], acceleration(t, x)])

    def guard(t: Any, y: Any, args: Any, **_: Any) -> Any:
        return wall - y[0] + raised

    def follow(t: Any, x: Any, mode: Any, j: Any) -> Any:
        return jnp.stack([wall + 0.0 * x[0], -physics.restitution * x[1]]), mode, j, jnp.asarray(STRUCK)

    return flow, [guard], follow, jnp.zeros(1), lambda _: jnp.inf
