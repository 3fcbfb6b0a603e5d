"""This module defines the public function `simulate`, which runs a model with an integrator."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from inspect import Parameter, signature
from os import PathLike
from typing import TYPE_CHECKING, Any, overload

from hybridsim import arguments
from hybridsim.calls import Default, renamed
from hybridsim.mechanics.declaration.system import MechanicalSystem
from hybridsim.model import Model

if TYPE_CHECKING:
    from hybridsim.solution import Solution


ALL_PARTS = Default("all")


@overload
def simulate(model: MechanicalSystem, t_span: tuple[float, float], **arguments: Any) -> Solution: ...
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
    keep: str | float = "all",
    limits: Mapping[str, float] | None = None,
    progress: Callable[[float], None] | bool | None = None,
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
    keep: str | float = ALL_PARTS,
    limits: Mapping[str, float] | None = None,
    progress: Callable[[float], None] | bool | None = None,
    **options: Any,
) -> Solution:
    """Simulate a model from t0 to t1 and return its trajectory, its events and its cost.

    Parameters
    ----------
    model : str, path, Model or MechanicalSystem
        A `Model`, the name of a packaged model, the path of a ``.toml`` file, or a `MechanicalSystem`, which
        has its own Taylor series integrator and ``moreau``.
    t_span : tuple of float
        (t0, t1); t1 < t0 runs backward in time.
    params : mapping of str to str or float, optional
        Parameter values that replace the declared ones: numbers, or expressions of other parameters.
    x0 : mapping of str to float or sequence of float, optional
        Initial values that replace the declared ones, by name (states and discrete states) or as a sequence
        of all states.
    z0 : mapping of str to str, optional
        Initial modes by component. For contacts and surfaces without an entry the engine finds the mode from x0. If
        x0 contradicts a mode given here, the state is projected onto its surface and ``sol.warnings`` reports it.
    integrator : str, optional
        A name from `list_integrators`. "auto" selects ``exact`` if all modes are linear in the states,
        ``rodas5p`` if they are stiff at the start, otherwise ``taylor`` for rtol below 1e-10 and ``dop853``.
        ``sol.message`` reports the selection and its reason.
    rtol, atol : float, mapping of str to float or sequence of float, optional
        Error control. The default of rtol is 1e-9. atol is one number, one number per state, or a mapping by
        name. Its default is rtol * 1e-3 * nominal; the nominal size is the declared one, otherwise ``|x0|``,
        otherwise 1. An integrator with a fixed step accepts neither.
    max_step, first_step : float, optional
        Largest step and length of the first step, in the unit of t.
    t_eval : sequence of float, optional
        Times of ``sol.t`` and ``sol.y``; the default is the steps of the integrator. It does not change the
        run.
    keep : str or float, optional
        Parts of the run to store, without any effect on the run itself. "all" stores everything, "events" no
        states between events, "last-period" the states and events of the last forcing period, a number those of
        the last such length of time, and "nothing" the final state, status and cost. With the last three the
        memory does not grow with the length of the run.
    limits : mapping of str to float, optional
        Limits of the run: "events", "steps", "seconds" of elapsed time, "megabytes" of memory growth. They are
        checked every 1024 events or 4096 steps in compiled code, so a run stops shortly after a limit is
        exceeded. It then has status "limit" and its partial result; ``sol.resume()`` continues it bit for bit as
        if it had never stopped.
    progress : bool or callable, optional
        True shows a bar in a terminal or a notebook, if the run takes more than half a second. A function is called
        at intervals with the finished fraction of the time span.
    **options : Any
        Options of the integrator. The former name of ``keep``, ``save``, is deprecated and works until version 0.2.

    Returns
    -------
    Solution
        The solution, also of a run that stopped early; ``sol.status`` and ``sol.message`` state the reason.

    Raises
    ------
    UsageError
        If an argument does not fit the model or the integrator.
    ModelError
        If the model is faulty.

    Examples
    --------
    >>> import hybridsim as hs
    >>> sol = hs.simulate("dfcs", t_span=(0, 0.1))
    >>> sol.status
    'finished'
    """
    if misplaced:
        raise arguments.without_a_name(misplaced[0])
    if "save" in options:
        keep = renamed("simulate", options, "save", "keep", keep)
    keep = str(keep) if isinstance(keep, Default) else keep
    if isinstance(model, MechanicalSystem):
        from hybridsim.mechanics.simulate import simulate_mechanical

        return simulate_mechanical(
            model, t_span, x0=x0, integrator=integrator, rtol=rtol, atol=atol, max_step=max_step, t_eval=t_eval,
            keep=keep, limits=limits, progress=progress, params=params, z0=z0, first_step=first_step, **options,
        )  # fmt: skip
    from hybridsim.preparation import Values, prepared
    from hybridsim.solution.running import carried_out

    model = arguments.chosen_model(model, None)
    on_progress = arguments.callback(progress)
    run, compile_time = prepared(
        model,
        t_span,
        Values(params, x0, z0),
        integrator=integrator,
        rtol=rtol,
        atol=atol,
        max_step=max_step,
        first_step=first_step,
        t_eval=t_eval,
        save=keep,
        limits=limits,
        options=options,
        keywords=KEYWORDS,
    )
    return carried_out(run, on_progress, compile_time)


_DECLARED = signature(simulate)
# positional arguments are accepted only to reject them with a remedy, so the displayed signature omits them
vars(simulate)["__signature__"] = _DECLARED.replace(
    parameters=[p for p in _DECLARED.parameters.values() if p.kind is not Parameter.VAR_POSITIONAL]
)
KEYWORDS = tuple(simulate.__kwdefaults__ or ())
