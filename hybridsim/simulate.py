"""The one place where model, integrator, decisions and solution meet."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from inspect import Parameter, signature
from os import PathLike
from typing import TYPE_CHECKING, Any, overload

from hybridsim import arguments
from hybridsim.mechanics.system import MechanicalSystem
from hybridsim.model import Model

if TYPE_CHECKING:
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
    *misplaced: Any,
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
        Initial modes by component; where a surface decides, the engine finds the mode from x0 if none is given. One
        that x0 rules out is taken all the same, the state is put onto the surface, and ``sol.warnings`` says so.
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
        process grows. A run that has had its share stops soon after (a compiled loop looks at them every 1024
        events or 4096 steps), with status "limit" and what it computed; ``sol.resume()`` goes on from there, to
        the same digits as if it had never stopped.
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
    if misplaced:
        raise arguments.without_a_name(misplaced[0])
    if isinstance(model, MechanicalSystem):
        from hybridsim.mechanics.simulate import simulate_mechanical

        return simulate_mechanical(
            model, t_span, x0=x0, integrator=integrator, rtol=rtol, atol=atol, max_step=max_step, t_eval=t_eval,
            save=save, limits=limits, progress=progress, params=params, z0=z0, first_step=first_step, **options,
        )  # fmt: skip
    from hybridsim.preparation import prepared

    model = arguments.chosen_model(model, params)
    told = arguments.callback(progress)
    run, compile_time = prepared(
        model,
        t_span,
        x0=x0,
        z0=z0,
        integrator=integrator,
        rtol=rtol,
        atol=atol,
        max_step=max_step,
        first_step=first_step,
        t_eval=t_eval,
        save=save,
        limits=limits,
        options=options,
        keywords=KEYWORDS,
    )
    return run.carried_out(told, compile_time)


_DECLARED = signature(simulate)
# what has no name is taken in order to be refused: the signature that is shown has what can be given
vars(simulate)["__signature__"] = _DECLARED.replace(
    parameters=[p for p in _DECLARED.parameters.values() if p.kind is not Parameter.VAR_POSITIONAL]
)
KEYWORDS = tuple(simulate.__kwdefaults__ or ())
