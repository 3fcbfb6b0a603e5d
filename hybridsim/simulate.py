"""The one place where model, integrator, decisions and solution meet."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from hybridsim import arguments
from hybridsim.errors import UsageError
from hybridsim.mechanics.system import MechanicalSystem
from hybridsim.model import Model

if TYPE_CHECKING:
    from hybridsim.engine.python_code import PythonCode
    from hybridsim.engine.system import System
    from hybridsim.integrators.base import Integrator
    from hybridsim.mechanics.solution import MechanicalSolution
    from hybridsim.mechanics.stepped_solution import SteppedSolution
    from hybridsim.solution import Solution


@overload
def simulate(
    model: MechanicalSystem, t_span: tuple[float, float], **arguments: Any
) -> MechanicalSolution | SteppedSolution: ...
@overload
def simulate(
    model: Model | str | PathLike[str],
    t_span: tuple[float, float],
    *,
    params: Mapping[str, Any] | None = None,
    x0: Mapping[str, float] | Sequence[float] | None = None,
    z0: Mapping[str, str] | None = None,
    integrator: str = "auto",
    rtol: float | None = None,
    atol: float | Mapping[str, float] | Sequence[float] | None = None,
    max_step: float = math.inf,
    first_step: float | None = None,
    t_eval: Sequence[float] | None = None,
    save: str | float = "all",
    limits: Mapping[str, float] | None = None,
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Solution: ...
def simulate(
    model: Model | MechanicalSystem | str | PathLike[str],
    t_span: tuple[float, float],
    *,
    params: Mapping[str, Any] | None = None,
    x0: Mapping[str, float] | Sequence[float] | None = None,
    z0: Mapping[str, str] | None = None,
    integrator: str = "auto",
    rtol: float | None = None,
    atol: float | Mapping[str, float] | Sequence[float] | None = None,
    max_step: float = math.inf,
    first_step: float | None = None,
    t_eval: Sequence[float] | None = None,
    save: str | float = "all",
    limits: Mapping[str, float] | None = None,
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Solution | MechanicalSolution | SteppedSolution:
    """Run a model from t0 to t1 and return its trajectory, its events and its cost.

    Parameters
    ----------
    model : str, path, Model or MechanicalSystem
        A `Model`, the name of a packaged one, or the path of a ``.toml`` file; or a `MechanicalSystem`, which
        runs by Taylor series of its own, or by ``moreau``.
    t_span : tuple of float
        (t0, t1); t1 < t0 runs backward in time.
    params : mapping of str to str or float, optional
        Parameter values that replace the declared ones: numbers, or expressions of other parameters.
    x0 : mapping of str to float or sequence of float, optional
        Initial values that replace the declared ones, by name (states and discrete states) or as a whole
        sequence.
    z0 : mapping of str to str, optional
        Initial modes by component; where a surface decides, the engine finds the mode from x0.
    integrator : str, optional
        A name from `list_integrators`; "auto" takes ``exact`` where all modes are linear in the states,
        ``rodas5p`` where they are stiff at the start, else ``taylor`` below rtol = 1e-10 and ``dop853``;
        ``sol.message`` says which and why.
    rtol, atol : float, mapping of str to float or sequence of float, optional
        Error control. rtol is 1e-9 if not given. atol is a number, one for each state, or by name; its
        default is rtol * 1e-3 * nominal, with the nominal size from the declaration, else ``|x0|``, else 1. An
        integrator with a fixed step refuses both.
    max_step, first_step : float, optional
        Bounds of the step, in the unit of t.
    t_eval : sequence of float, optional
        Times at which ``sol.t`` and ``sol.y`` are given; without it the integrator's own steps. It never
        changes the run.
    save : str or float, optional
        What is kept of the run, which it never changes. "all"; "events": no states between them;
        "last-period": the last period of the forcing, states and events; a number: the last so much time, in
        the unit of t; "nothing": the state at the end, status and cost. With the last three a run of any
        length takes the same memory.
    limits : mapping of str to float, optional
        What the run may cost, by name: "events", "steps", "seconds" by the clock, "megabytes" by which the
        process grows. A run that has had its share stops soon after, with status "limit" and what it
        computed; ``sol.resume()`` goes on from there, to the same digits as if it had never stopped.
    progress : callable, optional
        Called with the finished fraction of the span, from time to time.
    **options : Any
        Options of the integrator.

    Returns
    -------
    Solution
        Also where the run stopped early: ``sol.status`` and ``sol.message`` say why. Of a `MechanicalSystem`
        a `MechanicalSolution`, or a `SteppedSolution` by ``moreau``.

    Raises
    ------
    UsageError
        For anything that does not fit the model or the integrator.
    ModelError
        For a faulty model.

    Examples
    --------
    >>> import hybridsim as hs
    >>> sol = hs.simulate("dfcs", t_span=(0, 0.1))
    >>> sol.status
    'finished'
    """
    if isinstance(model, MechanicalSystem):
        from hybridsim.mechanics.simulate import simulate_mechanical

        return simulate_mechanical(
            model, t_span, x0=x0, integrator=integrator, rtol=rtol, atol=atol, max_step=max_step, t_eval=t_eval,
            save=save, limits=limits, progress=progress, params=params, z0=z0, first_step=first_step, **options,
        )  # fmt: skip
    model = arguments.chosen_model(model, params)
    x0_states, model = arguments.start_values(model, x0)
    span = arguments.time_span(t_span)
    callback = arguments.callback(progress)
    from hybridsim.engine.driving import refuse_driving
    from hybridsim.engine.jit import announce_compilation
    from hybridsim.engine.python_code import PythonCode
    from hybridsim.engine.recent import system_of
    from hybridsim.engine.stepping import Tolerances
    from hybridsim.engine.trajectory import Task
    from hybridsim.integrators.automatic import choose
    from hybridsim.integrators.registry import make_integrator
    from hybridsim.solution.run import Run

    announce_compilation()
    name = arguments.integrator_name(integrator)
    began = time.perf_counter()
    system, reason = system_of(model), ""
    modes = arguments.initial_modes(system, z0)
    if name == "auto":
        start, relative = system.start_state(x0_states), arguments.relative_tolerance(rtol)
        name, reason = choose(system, start, modes, span, relative)
    method = make_integrator(name, options, KEYWORDS)
    arguments.refuse_unused(method, rtol=rtol, atol=atol)
    if isinstance(system.code, PythonCode):
        _check_functions(method, system, system.code, system.start_state(x0_states), span[0])
    _refuse_velocity_powers(method, model)
    for function in system.hot_functions():
        system.address(function)
    method.prepare(system)
    compile_time = time.perf_counter() - began
    _refuse_lacking(method, model, system, span)
    start = system.start_state(x0_states)
    relative = arguments.relative_tolerance(rtol)
    tolerances = Tolerances(
        relative,
        arguments.absolute_tolerances(model, atol, relative, start),
        arguments.step_bound(max_step, "max_step"),
        None if first_step is None else arguments.step_bound(first_step, "first_step"),
    )
    keep = arguments.kept(save, system)
    grid = arguments.time_grid(t_eval, span, keep, save)
    task = Task(*span, start, modes, tolerances, system.discrete_start, keep, arguments.run_limits(limits))
    refuse_driving(system, span[0], start, task.discrete, modes)
    return Run(model, system, method, task, grid, save, reason).carried_out(callback, compile_time)


KEYWORDS = tuple(simulate.__kwdefaults__ or ())


def _check_functions(method: Integrator, system: System, code: PythonCode, x0: np.ndarray, t0: float) -> None:
    """Refuse what cannot run a model of Python functions, and functions that return something else than they should."""
    from hybridsim.engine.timepair import Instant

    reason, remedy = method.lacks.get("functions", ""), "write the model in expressions, or choose dop853"
    if code.refused and not method.name.startswith("scipy-"):
        reason, remedy = code.refused_in_words, "choose scipy-dop853, which calls them from Python"
    if reason:
        raise UsageError(f"{method.name} cannot run {system.model.name}: {reason}", remedy=remedy)
    code.check(x0, system.vector(Instant(t0), system.discrete_start))


def _refuse_velocity_powers(method: Integrator, model: Model) -> None:
    """Refuse to decide between stick and slip by derivatives that are not there."""
    from hybridsim.integrators.base import Integrator
    from hybridsim.model.velocity_powers import velocity_powers

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
    from hybridsim.integrators.registry import list_integrators

    needs = {
        "contacts": any(a.has_surface and not (a.is_unique or a.is_unilateral) for a in system.automata),
        "impacts": any(a.is_unilateral for a in system.automata),
        "sliding": any(a.is_unique for a in system.automata),
        "transitions": any(not a.has_surface for a in system.automata),
        "monitors": bool(model.monitors),
        "scheduled": bool(model.schedules or model.inputs),
        "backward": span[1] < span[0],
        "corners": "corners" in method.lacks and system.has_corners,
    }
    needed = [capability for capability, is_needed in needs.items() if is_needed]
    for capability in needed:
        if capability in method.lacks:
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
