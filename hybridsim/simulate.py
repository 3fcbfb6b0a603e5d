"""The one place where model, integrator, decisions and solution meet."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.errors import ModelError, UsageError, nearest
from hybridsim.model import Model, load

if TYPE_CHECKING:
    from hybridsim.engine.system import System
    from hybridsim.integrators.base import Integrator
    from hybridsim.solution import Solution

# The smallest rtol that means anything: a hundred units in the last place, as SciPy has it.
SMALLEST_RTOL = 100 * 2.0**-52


def simulate(
    model: Model | str | PathLike[str],
    t_span: tuple[float, float],
    *,
    params: Mapping[str, Any] | None = None,
    x0: Mapping[str, float] | Sequence[float] | None = None,
    z0: Mapping[str, str] | None = None,
    integrator: str = "auto",
    rtol: float = 1e-9,
    atol: float | Mapping[str, float] | Sequence[float] | None = None,
    max_step: float = math.inf,
    first_step: float | None = None,
    t_eval: Sequence[float] | None = None,
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Solution:
    """Run a model from t0 to t1 and return its trajectory, its events and its cost.

    Parameters
    ----------
    model : a `Model`, the name of a packaged one, or the path of a ``.toml`` file.
    t_span : (t0, t1); t1 < t0 runs backward in time.
    params : parameter values that replace the declared ones: numbers, or expressions of other parameters.
    x0 : initial values that replace the declared ones, by name (states and discrete states) or as a whole sequence.
    z0 : initial modes by component; where a surface decides, the engine finds the mode from x0.
    integrator : a name from `list_integrators`; "auto" takes the default work-horse, ``dop853``.
    rtol, atol : error control. atol is a number, one for each state, or by name; its default is
        rtol * 1e-3 * nominal, with the nominal size from the declaration, else |x0|, else 1.
    max_step, first_step : bounds of the step, in the unit of t.
    t_eval : times at which ``sol.t`` and ``sol.y`` are given; without it the integrator's own steps. It never
        changes the run.
    progress : called with the finished fraction of the span, from time to time.
    options : options of the integrator.

    Returns
    -------
    Solution, also where the run stopped early: ``sol.status`` and ``sol.message`` say why.

    Errors
    ------
    UsageError for anything that does not fit the model or the integrator; ModelError for a faulty model.

    Examples
    --------
    >>> import hybridsim as hs
    >>> sol = hs.simulate("dfcs", t_span=(0, 0.1))
    >>> sol.status
    'finished'
    """
    if not isinstance(model, Model):
        model = load(model)
    if params:
        model = model.with_(**params)
    x0_states, model = _start(model, x0)
    model.validate()
    span = _span(t_span)
    from hybridsim.engine.jit import announce_compilation
    from hybridsim.engine.system import System
    from hybridsim.integrators.registry import make_integrator

    announce_compilation()
    method = make_integrator("dop853" if integrator == "auto" else integrator, options)
    began = time.perf_counter()
    system = System(model)
    for name in system.hot_functions():
        system.address(name)
    compile_time = time.perf_counter() - began
    _refuse_lacking(method, model, system, span)
    return _run(
        model,
        system,
        method,
        span,
        x0_states,
        _modes(system, z0),
        progress,
        compile_time,
        t_eval,
        rtol,
        atol,
        max_step,
        first_step,
    )


def _run(
    model: Model,
    system: System,
    method: Integrator,
    span: tuple[float, float],
    x0: Mapping[str, float],
    z0: np.ndarray,
    progress: Callable[[float], None] | None,
    compile_time: float,
    t_eval: Sequence[float] | None,
    rtol: float,
    atol: Any,
    max_step: float,
    first_step: float | None,
) -> Solution:
    from hybridsim.engine.stepping import Tolerances
    from hybridsim.engine.trajectory import Task
    from hybridsim.solution import Solution

    start = system.start_state(x0)
    tolerances = Tolerances(
        _rtol(rtol),
        _atol(model, atol, rtol, start),
        _step(max_step, "max_step"),
        None if first_step is None else _step(first_step, "first_step"),
    )
    discrete = np.array([model.discrete_values()[d.name] for d in model.discrete], dtype=float)
    task = Task(span[0], span[1], start, z0, tolerances, discrete)
    grid = None if t_eval is None else _grid(t_eval, span)
    _refuse_driving(system, span[0], start, discrete, z0)
    began = time.perf_counter()
    trajectory = method.run(system, task, progress)
    wall_time = time.perf_counter() - began
    return Solution(model, system, trajectory, method.name, wall_time, compile_time, grid, span)


def _start(model: Model, x0: Mapping[str, float] | Sequence[float] | None) -> tuple[dict[str, float], Model]:
    names = [s.name for s in model.states]
    if x0 is None:
        return {}, model
    if not isinstance(x0, Mapping):
        values = [float(v) for v in x0]
        if len(values) != len(names):
            raise UsageError(
                f"x0 has {len(values)} values and model {model.name} has {len(names)} states ({', '.join(names)})",
                remedy="give one value for each state, or a mapping from names to values",
            )
        x0 = dict(zip(names, values, strict=True))
    discrete = [d.name for d in model.discrete]
    for name, value in x0.items():
        if name not in names + discrete:
            raise UsageError(
                f"x0 names {name!r}, which is no state of model {model.name}",
                remedy=nearest(name, names + discrete, kind="states"),
            )
        if not math.isfinite(float(value)):
            raise UsageError(f"x0 of {name} is {value!r}", remedy="give a finite number")
    changed = {n: v for n, v in x0.items() if n in discrete}
    return {n: float(v) for n, v in x0.items() if n in names}, model.with_start(
        **changed
    ) if changed else model


def _span(t_span: tuple[float, float]) -> tuple[float, float]:
    try:
        t0, t1 = (float(t) for t in t_span)
    except (TypeError, ValueError):
        raise UsageError(f"t_span is {t_span!r}", remedy="give two numbers, (t0, t1)") from None
    if not (math.isfinite(t0) and math.isfinite(t1)):
        raise UsageError(
            f"t_span is {t_span!r}", remedy="give two finite numbers; a monitor can end a run early"
        )
    return t0, t1


def _rtol(rtol: float) -> float:
    if not (SMALLEST_RTOL <= rtol < 1.0):
        raise UsageError(f"rtol is {rtol!r}", remedy=f"give a number from {SMALLEST_RTOL:.2g} to below 1")
    return float(rtol)


def _step(value: float, name: str) -> float:
    if not value > 0.0:
        raise UsageError(f"{name} is {value!r}", remedy="give a positive number")
    return float(value)


def _atol(model: Model, atol: Any, rtol: float, start: np.ndarray) -> np.ndarray:
    names = [s.name for s in model.states]
    sizes = [s.nominal or abs(x) or 1.0 for s, x in zip(model.states, start, strict=True)]
    default = 1e-3 * rtol * np.array(sizes, dtype=float)
    if atol is None:
        return default
    if isinstance(atol, Mapping):
        for name, value in atol.items():
            if name not in names:
                raise UsageError(
                    f"atol names {name!r}, which is no state of model {model.name}",
                    remedy=nearest(name, names, kind="states"),
                )
            default[names.index(name)] = value
        atol = default
    values = (
        np.broadcast_to(np.asarray(atol, dtype=float), default.shape)
        if np.ndim(atol) == 0
        else np.array(atol)
    )
    if values.shape != default.shape or not (np.isfinite(values).all() and (values >= 0).all()):
        raise UsageError(
            f"atol is {atol!r}", remedy=f"give a number >= 0, or one for each of {', '.join(names)}"
        )
    return values.astype(float)


def _modes(system: System, z0: Mapping[str, str] | None) -> np.ndarray:
    z = np.array([a.initial for a in system.automata], dtype=np.int64)
    for name, mode in (z0 or {}).items():
        components = [a.name for a in system.automata]
        if name not in components:
            raise UsageError(
                f"z0 names {name!r}, which is no component of model {system.model.name}",
                remedy=nearest(name, components, kind="components"),
            )
        automaton = system.automata[components.index(name)]
        if mode not in automaton.modes:
            raise UsageError(
                f"z0 of {name} is {mode!r}, which is no mode of it",
                remedy=nearest(mode, automaton.modes, kind="modes"),
            )
        z[components.index(name)] = automaton.modes.index(mode)
    return z


def _grid(t_eval: Sequence[float], span: tuple[float, float]) -> np.ndarray:
    grid = np.asarray(t_eval, dtype=float)
    low, high = min(span), max(span)
    if (
        grid.ndim != 1
        or not np.isfinite(grid).all()
        or (len(grid) and (grid.min() < low or grid.max() > high))
    ):
        raise UsageError(f"t_eval does not lie within t_span {span}", remedy="give times from t0 to t1")
    return grid


def _refuse_driving(system: System, t0: float, x: np.ndarray, discrete: np.ndarray, z: np.ndarray) -> None:
    """Refuse a contact whose force pushes its own relative velocity on instead of opposing it."""
    from hybridsim.engine.timepair import Instant

    try:
        effects = system.effects(0.0, x, system.vector(Instant(t0), discrete), np.maximum(z, 0))
    except (ZeroDivisionError, ValueError, OverflowError):
        return  # not a number at the start: the run itself says where
    for c, effect in effects.items():
        if effect >= 0.0:
            name = system.automata[c].name
            raise ModelError(
                f"contact {name}: the force {name} acts along its relative velocity, not against it "
                f"(its effect on the relative acceleration is {effect:.6g}, and should be negative)",
                remedy=f"let {name} enter the derivative of the velocity as '- {name}', or turn the velocity round",
            )


def _refuse_lacking(method: Integrator, model: Model, system: System, span: tuple[float, float]) -> None:
    needs = {
        "contacts": any(a.has_surface for a in system.automata),
        "transitions": any(not a.has_surface for a in system.automata),
        "monitors": bool(model.monitors),
        "scheduled": bool(model.schedules or model.inputs),
        "backward": span[1] < span[0],
    }
    for capability, needed in needs.items():
        if needed and capability in method.lacks:
            raise UsageError(
                f"{method.name} cannot run {model.name}: {method.lacks[capability]}",
                remedy="choose another integrator (hs.list_integrators() says what each lacks)",
            )
