"""This module checks the arguments of `simulate` and prepares the run: model, system, method and task.

It is separate from `simulate` because it imports the engine, which a program that only declares models does not need.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from hybridsim import arguments
from hybridsim.engine.events.dissipation_check import require_dissipation
from hybridsim.engine.native.compiler import announce_compilation
from hybridsim.engine.record.limits import UNLIMITED
from hybridsim.engine.record.retention import Retention
from hybridsim.engine.record.trajectory import Task
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System
from hybridsim.engine.system.system_cache import bound, runs_of, system_of
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.engine.system.user_functions.code import PythonCode
from hybridsim.errors import UsageError
from hybridsim.integrators.automatic import choose, successor_of
from hybridsim.integrators.contract import Integrator
from hybridsim.integrators.fixed_step.step_length import refuse_endless
from hybridsim.integrators.registry import integrator_class, list_integrators, make_integrator
from hybridsim.model import Model
from hybridsim.model.laws.velocity_powers import velocity_powers
from hybridsim.solution.run import Run

_MAX_RUNS = 16  # prepared runs stored per model; a loop usually repeats one or a few
_PLAIN = frozenset({int, float, np.float64, str, type(None)})  # types whose equal values are interchangeable


def _run_key(t_span: Any, settings: tuple[Any, ...]) -> tuple[Any, ...] | None:
    """Return a key that identifies the arguments of a run, or None if an argument is not a plain value.

    Checking the arguments costs up to a tenth of a short run, and loops often repeat the same arguments.
    """
    run_key = (*t_span, *settings) if type(t_span) is tuple else (t_span,)
    return run_key if _PLAIN.issuperset(map(type, run_key)) else None


class Values(NamedTuple):
    """The values that replace those of the model in a run, as in `simulate`."""

    params: Any = None
    x0: Any = None
    z0: Any = None


class _Settings(NamedTuple):
    """The settings of a run that do not depend on numbers of the model; they are checked once for each structure."""

    span: tuple[float, float]
    method: Integrator
    rtol: float
    longest: float
    first_step: float | None
    retention: Retention | None  # None for the last period, whose length depends on numbers


class _SettingsOfRuns(dict[tuple[Any, ...], _Settings]):
    """Settings of runs, by arguments. Pickled models leave them out, because a method may be a local class."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _SettingsOfRuns, ()


def _known_settings(model: Model, key: tuple[Any, ...] | None) -> _Settings | None:
    """Return the settings of an earlier run of a model with the same structure and the same arguments."""
    known: _SettingsOfRuns = model.once("settings of runs", _SettingsOfRuns)
    found = None if key is None else known.get(key)
    is_registered = found is not None and type(found.method) is integrator_class(found.method.name)
    return found if is_registered else None


def _store_settings(model: Model, key: tuple[Any, ...], settings: _Settings) -> None:
    known: _SettingsOfRuns = model.once("settings of runs", _SettingsOfRuns)
    if len(known) >= _MAX_RUNS:
        known.clear()
    known[key] = settings


def prepared(
    model: Model,
    t_span: Any,
    values: Values,
    *,
    integrator: Any,
    rtol: Any,
    atol: Any,
    max_step: Any,
    first_step: Any,
    t_eval: Any,
    save: Any,
    limits: Any,
    options: dict[str, Any],
    keywords: Sequence[str],
) -> tuple[Run, float]:
    """Return the prepared run and the compile time in seconds; `keywords` are names to suggest."""
    every_argument: tuple[Any, ...] = (integrator, rtol, atol, max_step, first_step, save)
    if options:  # an integer option rejects 16.0, which equals 16
        every_argument += (*chain(*options.items()), *(type(value).__name__ for value in options.values()))
    key = _run_key(t_span, every_argument)
    params, x0, z0 = values
    run_key = key if params is x0 is z0 is limits is None else None
    if run_key is not None:
        run = runs_of(model).get(run_key)
        if run is not None and type(run.method) is integrator_class(run.method.name):  # still registered
            span = run.task.t0, run.task.t1
            return run.on_grid(arguments.time_grid(t_eval, span, run.task.retention, save)), 0.0
    original, (x0_states, model) = model, arguments.start_values(arguments.chosen_model(model, params), x0)
    known = _known_settings(model, key)
    span = arguments.time_span(t_span) if known is None else known.span
    announce_compilation()
    name = arguments.integrator_name(integrator)
    began = time.perf_counter()
    # only a model that the caller has can come again
    system, reason = system_of(model) if model is original else bound(model), ""
    modes, start = arguments.initial_modes(system, z0), system.start_state(x0_states)
    if known is not None:
        method = known.method
    else:
        if name == "auto":
            name, reason = choose(system, start, modes, span, arguments.relative_tolerance(rtol))
        method = make_integrator(name, options, keywords)
        arguments.refuse_unused(method, rtol=rtol, atol=atol)
    if isinstance(system.code, PythonCode):
        _check_functions(method, system, system.code, start, span[0])
    _refuse_velocity_powers(method, model)
    if known is None:
        for function in system.hot_functions():
            system.address(function)
    method.prepare(system)
    compile_time = time.perf_counter() - began
    if known is None:
        _refuse_lacking(method, model, system, span)
        known = _Settings(
            span,
            method,
            arguments.relative_tolerance(rtol),
            arguments.step_bound(max_step, "max_step"),
            None if first_step is None else arguments.step_bound(first_step, "first_step"),
            None if isinstance(save, str) and save == "last-period" else arguments.retention_of(save, system),
        )
        refuse_endless(known.longest, span, "max_step")
        if key is not None and integrator != "auto":
            _store_settings(model, key, known)
    atols = arguments.absolute_tolerances(model, atol, known.rtol, start)
    tolerances = Tolerances(known.rtol, atols, known.longest, known.first_step)
    retention = known.retention or arguments.retention_of(save, system)
    grid = arguments.time_grid(t_eval, span, retention, save)
    discrete, bounded = system.discrete_start, UNLIMITED if limits is None else arguments.run_limits(limits)
    successor = successor_of(name, system) if reason else None
    task = Task(*span, start, modes, tolerances, discrete, retention, bounded, successor=successor)
    require_dissipation(system, span[0], start, discrete, modes)
    run = Run(model, system, method, task, None, save, reason)
    if run_key is not None and not isinstance(system.code, PythonCode):  # a Python function may change
        runs = runs_of(model)
        if len(runs) >= _MAX_RUNS:
            runs.clear()
        runs[run_key] = run
    return run.on_grid(grid), compile_time


def _check_functions(method: Integrator, system: System, code: PythonCode, x0: np.ndarray, t0: float) -> None:
    """Raise an error if the method cannot use the model's Python functions, or if a function returns a wrong result."""
    reason, remedy = method.lacks.get("functions", ""), "write the model in expressions, or use dop853"
    if code.refused and not method.name.startswith("scipy-"):
        reason, remedy = code.refusal_message, "use scipy-dop853, which calls the functions in Python"
    if reason:
        raise UsageError(f"{method.name} cannot run model '{system.model.name}': {reason}", remedy=remedy)
    code.check(x0, system.vector(Instant(t0), system.discrete_start))


def _refuse_velocity_powers(method: Integrator, model: Model) -> None:
    """Raise an error for powers of a contact velocity that have no derivatives at zero."""
    if type(method).run is not Integrator.run:
        return  # the method selects the modes itself, without derivatives
    for power in velocity_powers(model):
        raise UsageError(
            f"{method.name} cannot run model '{model.name}': '{power.text}' in {power.where} has no Taylor series at "
            f"zero velocity of contact {power.contact}, so the solver cannot decide between stick and slip",
            place=power.place,
            remedy=f"{power.remedy}, or use integrator='moreau', step=..., which needs no derivatives",
        )


def _refuse_lacking(method: Integrator, model: Model, system: System, span: tuple[float, float]) -> None:
    # tests whether the model needs a capability; evaluated only for capabilities that the method lacks
    needs: dict[str, Callable[[], bool]] = {
        "contacts": lambda: any(
            a.has_surface and not (a.is_unique or a.is_unilateral) for a in system.automata
        ),
        "impacts": lambda: any(a.is_unilateral for a in system.automata),
        "sliding": lambda: any(a.is_unique for a in system.automata),
        "transitions": lambda: any(not a.has_surface for a in system.automata),
        "monitors": lambda: bool(model.monitors),
        "scheduled": lambda: bool(model.schedules or model.inputs),
        "backward": lambda: span[1] < span[0],
        "corners": lambda: system.has_corners,
    }
    for capability in needs:
        if capability in method.lacks and needs[capability]():
            required = [other for other, is_required in needs.items() if is_required()]
            # exclude methods for linear models, since nonlinearity is only checked later
            able = [one.name for one in list_integrators() if not {"nonlinear", *required} & one.lacks.keys()]
            suggestion = (
                f"use an integrator that supports it, such as {', '.join(able[:3])}"
                if able
                else "no integrator supports the whole model"
            )
            raise UsageError(
                f"{method.name} cannot run model '{model.name}': {method.lacks[capability]}",
                remedy=f"{suggestion}; hs.list_integrators() lists all limitations",
            )
