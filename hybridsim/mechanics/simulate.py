"""This module runs `hs.simulate` for mechanical systems: it checks the arguments and calls the kernels."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from hybridsim import arguments
from hybridsim.engine.native.compiler import announce_compilation
from hybridsim.engine.record.retention import ALL
from hybridsim.errors import UsageError, nearest
from hybridsim.integrators.registry import integrator_class, keyword_elsewhere
from hybridsim.mechanics.declaration.system import MechanicalSystem
from hybridsim.mechanics.series_loop.mechanical_arrays import build
from hybridsim.mechanics.series_loop.run import MechanicalRun
from hybridsim.mechanics.series_loop.series_trajectory import SeriesTrajectory
from hybridsim.solution.solution import Solution

# Arguments of `simulate` that are not supported here, with the alternatives.
_OF_MODELS = {
    "params": "put the values into the arrays of the system, or simulate system.to_model()",
    "z0": "leave it out: x0 determines which contacts stick at the start",
    "first_step": "leave it out: the Taylor series determines the step size",
}
_OF_MOREAU = ("steps_per_period", "period", "step", "theta", "tolerance", "iterations")

_IF_INDEPENDENT = "(possible if the directions of its contacts and gaps are linearly independent)"


def simulate_mechanical(
    system: MechanicalSystem,
    t_span: tuple[float, float],
    *,
    x0: Mapping[str, float] | Sequence[float] | None = None,
    integrator: str = "auto",
    rtol: float | None = None,
    atol: Any = None,
    max_step: float = math.inf,
    t_eval: Sequence[float] | None = None,
    keep: str | float = "all",
    limits: Mapping[str, float] | None = None,
    progress: Callable[[float], None] | bool | None = None,
    **refused: Any,
) -> Solution:
    """Simulate a `MechanicalSystem`; `hybridsim.simulate.simulate` describes the arguments.

    Raises
    ------
    UsageError
        For unsupported arguments: other integrators, params, z0, a first step, or a backward run.
    """
    from hybridsim.integrators.fixed_step.step_length import refuse_endless, refuse_longer

    name = arguments.integrator_name(integrator)
    if name not in ("auto", "taylor", "moreau"):
        integrator_class(name)  # refuses unknown integrators
        raise UsageError(
            f"{name} cannot simulate a MechanicalSystem",
            remedy=f"use integrator='taylor', or simulate system.to_model() with {name} {_IF_INDEPENDENT}",
        )
    if system.impacts and name != "moreau":
        raise UsageError(
            f"{name} cannot simulate a MechanicalSystem with impacts",
            remedy=f'use integrator="moreau", step=..., or convert a small system by to_model() {_IF_INDEPENDENT}',
        )
    method: Any = None
    if name == "moreau":
        from hybridsim.integrators.registry import make_integrator

        method = make_integrator(name, {key: refused.pop(key) for key in _OF_MOREAU if key in refused})
        arguments.refuse_unused(method, rtol=rtol, atol=atol)
    for argument, value in refused.items():
        if argument in _OF_MOREAU:
            raise UsageError(f"`{argument}` is an option of moreau", remedy='use integrator="moreau"')
        if argument not in _OF_MODELS:
            taken = (*(simulate_mechanical.__kwdefaults__ or ()), *_OF_MOREAU)
            raise UsageError(
                f"simulate() has no argument {argument!r} for a MechanicalSystem",
                remedy=keyword_elsewhere(argument) or nearest(argument, taken, kind="arguments"),
            )
        if value is not None:
            raise UsageError(f"a MechanicalSystem does not support `{argument}`", remedy=_OF_MODELS[argument])
    span = arguments.time_span(t_span)
    if span[1] < span[0]:
        raise UsageError(
            f"`t_span` cannot be {t_span!r}",
            remedy="use t1 >= t0 (time runs forward only), or simulate system.to_model()",
        )
    if not (isinstance(keep, str) and keep in ("all", "events", "nothing")):
        raise UsageError(
            f"`keep` cannot be {keep!r}", remedy="for a MechanicalSystem use 'all', 'events' or 'nothing'"
        )
    start, relative = start_of(system, x0), arguments.relative_tolerance(rtol)
    absolute = _absolute(system, atol, relative, start)
    longest = arguments.step_bound(max_step, "max_step")
    refuse_endless(longest, span, "max_step")
    grid = None if t_eval is None else arguments.time_grid(t_eval, span, ALL, keep)
    callback, most = arguments.callback(progress), arguments.run_limits(limits)
    announce_compilation()
    began = time.perf_counter()
    if method is not None:
        from hybridsim.mechanics.time_stepping.run import SteppedRun
        from hybridsim.mechanics.time_stepping.stepped_trajectory import SteppedTrajectory

        stepped = SteppedRun(system, method, span, start, keep == "all", most)
        refuse_longer(stepped.step, longest, name)
        built_in = time.perf_counter() - began
        stepped.go(callback)
        built_in += stepped.compile_time
        cost = (time.perf_counter() - began - built_in, built_in)
        return Solution(SteppedTrajectory(stepped, grid, str(keep), cost))
    run = MechanicalRun(build(system), span, start, relative, absolute, longest, keep == "all", most)
    built_in = time.perf_counter() - began
    run.go(callback)
    built_in += run.compile_time
    cost = (time.perf_counter() - began - built_in, built_in)
    return Solution(SeriesTrajectory(system, run, grid, str(keep), cost))


def start_of(system: MechanicalSystem, x0: Any) -> np.ndarray:
    """Return the initial positions and velocities (2n,), from `x0` if given there, otherwise from the system."""
    names = (*system.names, *system.velocities)
    start = np.concatenate([system.q0, system.v0])
    if x0 is None:
        return start
    if isinstance(x0, Mapping):
        for name, value in x0.items():
            if name not in names:
                raise UsageError(
                    f"`x0` contains {name!r}, which is not a state of {system.name}",
                    remedy=nearest(str(name), names, kind="states"),
                )
            start[names.index(name)] = arguments.number(value, f"x0 of {name}")
    else:
        start = arguments.numbers(x0, "x0", f"use {len(names)} numbers: positions, then velocities")
    if start.shape != (len(names),) or not np.isfinite(start).all():
        raise UsageError(
            f"`x0` cannot be {x0!r}", remedy=f"use {len(names)} finite numbers: positions, then velocities"
        )
    return start


def _absolute(system: MechanicalSystem, atol: Any, rtol: float, start: np.ndarray) -> np.ndarray:
    """Return the absolute tolerances (2n,), by default rtol * 1e-3 * |x0|, with 1 in place of a zero |x0|."""
    if atol is None:
        return 1e-3 * rtol * np.where(start == 0.0, 1.0, abs(start))
    remedy = f"use a number >= 0, or {len(start)} of them"
    if arguments.is_row(atol):
        values = arguments.numbers(atol, "atol", remedy)
    else:
        values = np.full(len(start), arguments.number(atol, "atol", remedy))
    if values.shape != start.shape or not (np.isfinite(values).all() and (values >= 0).all()):
        raise UsageError(f"`atol` cannot be {atol!r}", remedy=remedy)
    return values
