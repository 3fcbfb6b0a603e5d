"""From the arguments of `simulate` to a run: model, system, method and task, each checked.

Apart from `simulate` because it imports the engine, which a program that only declares models does without.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from itertools import chain
from typing import Any

import numpy as np

from hybridsim import arguments
from hybridsim.engine.driving import refuse_driving
from hybridsim.engine.jit import announce_compilation
from hybridsim.engine.python_code import PythonCode
from hybridsim.engine.recent import known_system, system_of
from hybridsim.engine.stepping import Tolerances
from hybridsim.engine.system import System
from hybridsim.engine.timepair import Instant
from hybridsim.engine.trajectory import Task
from hybridsim.errors import UsageError
from hybridsim.integrators.automatic import choose, successor_of
from hybridsim.integrators.base import Integrator
from hybridsim.integrators.fixed_step_length import refuse_endless
from hybridsim.integrators.registry import integrator_class, list_integrators, make_integrator
from hybridsim.model import Model
from hybridsim.model.velocity_powers import velocity_powers
from hybridsim.solution.run import Run

_MOST = 16  # runs that a system remembers: a loop asks for one or a few, and what is kept of each is small
_PLAIN = frozenset({int, float, np.float64, str, type(None)})  # what is equal to another means the same


def _question(t_span: Any, words: tuple[Any, ...]) -> tuple[Any, ...] | None:
    """What is asked, by which a run is known again; None where anything but plain numbers and words is among it.

    To check and to bind the arguments takes as long as a tenth of a short run, and loops ask the same again and again.
    """
    question = (*t_span, *words) if type(t_span) is tuple else (t_span,)
    return question if _PLAIN.issuperset(map(type, question)) else None


def prepared(
    model: Model,
    t_span: Any,
    *,
    x0: Any,
    z0: Any,
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
    """The run of these arguments, and the seconds that compiling took; keywords: what an option may be meant to be."""
    question = None
    if x0 is z0 is limits is None:
        words: tuple[Any, ...] = (integrator, rtol, atol, max_step, first_step, save)
        if options:  # an option that is a whole number is refused as 16.0, which equals 16
            words += (*chain(*options.items()), *(type(value).__name__ for value in options.values()))
        question = _question(t_span, words)
        known = known_system(model)
        run = None if known is None else known.runs.get(question)
        if run is not None and type(run.method) is integrator_class(run.method.name):  # as registered now
            span = run.task.t0, run.task.t1
            return run.on_grid(arguments.time_grid(t_eval, span, run.task.keep, save)), 0.0
    x0_states, model = arguments.start_values(model, x0)
    span = arguments.time_span(t_span)
    announce_compilation()
    name = arguments.integrator_name(integrator)
    began = time.perf_counter()
    system, reason = system_of(model), ""
    modes, start = arguments.initial_modes(system, z0), system.start_state(x0_states)
    if name == "auto":
        name, reason = choose(system, start, modes, span, arguments.relative_tolerance(rtol))
    method = make_integrator(name, options, keywords)
    arguments.refuse_unused(method, rtol=rtol, atol=atol)
    if isinstance(system.code, PythonCode):
        _check_functions(method, system, system.code, start, span[0])
    _refuse_velocity_powers(method, model)
    for function in system.hot_functions():
        system.address(function)
    method.prepare(system)
    compile_time = time.perf_counter() - began
    _refuse_lacking(method, model, system, span)
    relative = arguments.relative_tolerance(rtol)
    longest = arguments.step_bound(max_step, "max_step")
    refuse_endless(longest, span, "max_step")
    tolerances = Tolerances(
        relative,
        arguments.absolute_tolerances(model, atol, relative, start),
        longest,
        None if first_step is None else arguments.step_bound(first_step, "first_step"),
    )
    keep = arguments.kept(save, system)
    grid = arguments.time_grid(t_eval, span, keep, save)
    discrete = system.discrete_start
    task = Task(
        *span, start, modes, tolerances, discrete, keep, arguments.run_limits(limits),
        successor=successor_of(name, system) if reason else None,
    )  # fmt: skip
    refuse_driving(system, span[0], start, discrete, modes)
    run = Run(model, system, method, task, None, save, reason)
    if question is not None and not isinstance(system.code, PythonCode):  # which may change its answers
        if len(system.runs) >= _MOST:
            system.runs.clear()
        system.runs[question] = run
    return run.on_grid(grid), compile_time


def _check_functions(method: Integrator, system: System, code: PythonCode, x0: np.ndarray, t0: float) -> None:
    """Refuse what cannot run a model of Python functions, and functions that return something else than they should."""
    reason, remedy = method.lacks.get("functions", ""), "write the model in expressions, or choose dop853"
    if code.refused and not method.name.startswith("scipy-"):
        reason, remedy = code.refused_in_words, "choose scipy-dop853, which calls them from Python"
    if reason:
        raise UsageError(f"{method.name} cannot run {system.model.name}: {reason}", remedy=remedy)
    code.check(x0, system.vector(Instant(t0), system.discrete_start))


def _refuse_velocity_powers(method: Integrator, model: Model) -> None:
    """Refuse to decide between stick and slip by derivatives that are not there."""
    if type(method).run is not Integrator.run:
        return  # it decides by itself, and takes no derivative
    for power in velocity_powers(model):
        raise UsageError(
            f"{method.name} cannot run {model.name}: '{power.text}' in {power.where} is a root of the "
            f"velocity of contact {power.contact}, or a power of it that is not written as a whole number: it has no "
            "Taylor series where the contact sticks, so that stick and slip cannot be told apart there",
            place=power.place,
            remedy=f"{power.remedy}; or choose integrator='moreau', step=..., which takes no derivatives",
        )


def _refuse_lacking(method: Integrator, model: Model, system: System, span: tuple[float, float]) -> None:
    # capabilities that a model may need, and what tells that it does, asked for those alone that the method lacks
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
            needed = [other for other, is_needed in needs.items() if is_needed()]
            # what is not linear is not known here, and would be refused next
            able = [one.name for one in list_integrators() if not {"nonlinear", *needed} & one.lacks.keys()]
            such = (
                f"choose one that can, such as {', '.join(able[:3])}"
                if able
                else "no integrator takes all of it"
            )
            raise UsageError(
                f"{method.name} cannot run {model.name}: {method.lacks[capability]}",
                remedy=f"{such} (hs.list_integrators() says what each lacks)",
            )
