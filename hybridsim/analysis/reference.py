"""What the errors of a comparison are relative to, and how well it is known itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from hybridsim.analysis.closed_forms import find_closed_form
from hybridsim.analysis.errors_against_reference import Errors, Yardstick
from hybridsim.analysis.resets import resets_of
from hybridsim.analysis.trajectory import Trajectory, as_trajectory, trajectory_of
from hybridsim.errors import HybridsimError, SimulationError, UsageError

if TYPE_CHECKING:
    from hybridsim.model import Model
    from hybridsim.solution import Solution

Run = Callable[..., "Solution"]
"""Runs the model over the span: (integrator, **options) -> Solution."""

CLOSED_FORM, RUNS = "closed form", "runs"
# Two methods of different kind (one step against many steps, our location of events against SUNDIALS' own),
# close to the least tolerance that each can keep in double precision.
_FIRST: tuple[str, Mapping[str, Any]] = ("scipy-dop853", {"rtol": 1e-13})
_SECOND: tuple[str, Mapping[str, Any]] = ("cvode-adams", {"rtol": 1e-12})


@dataclass(frozen=True)
class Reference:
    """A reference.

    Parameters
    ----------
    title : what it is, in words.
    yardstick : measures runs against it.
    uncertainty : how far off a second reference is; None where there is none.
    warnings : what makes it doubtful.
    """

    title: str
    yardstick: Yardstick
    uncertainty: Errors | None
    warnings: tuple[str, ...] = ()


def find_reference(
    model: Model, t_span: tuple[float, float], period: float | None, run: Run, wanted: Any = None
) -> Reference:
    """The reference of a comparison.

    Parameters
    ----------
    wanted : None for a closed form where one is known, else two runs; "closed form" or "runs" to insist; or
        the reference itself: a Solution, a Trajectory, or a function of times (k,) that gives states (n, k).
    run : runs the model with an integrator and its options.

    A closed form owes nothing to the engine. Of two runs the first is the reference, and the distance of the
    second its uncertainty. Both follow the engine's decisions at events: what it got wrong would not show.
    """
    if isinstance(wanted, str) and wanted not in (CLOSED_FORM, RUNS):
        raise UsageError(f"reference {wanted!r} is unknown", remedy=f"say {CLOSED_FORM!r} or {RUNS!r}")

    def yardstick(trajectory: Trajectory) -> Yardstick:
        nominal = [state.nominal or 1.0 for state in model.states]
        return Yardstick(trajectory, resets_of(model), nominal, period)

    if wanted is not None and not isinstance(wanted, str):
        return Reference("given by the caller", yardstick(as_trajectory(wanted, t_span)), None)
    if wanted != RUNS:
        closed = find_closed_form(model, t_span)
        if closed is not None:
            exact = yardstick(closed.exact)
            return Reference(closed.title, exact, exact.measure(closed.nudged))
        if wanted == CLOSED_FORM:
            raise UsageError(f"no closed form is known for {model.name}", remedy=f"use reference={RUNS!r}")
    return _two_runs(run, yardstick)


def _two_runs(run: Run, yardstick: Callable[[Trajectory], Yardstick]) -> Reference:
    first = run(_FIRST[0], **_FIRST[1])
    if not first.success:
        raise SimulationError(
            f"the reference run with {_describe(_FIRST)} ended as {first.status}: {first.message}",
            remedy="shorten the span, or give a reference",
        )
    best = yardstick(trajectory_of(first))
    title = f"run with {_describe(_FIRST)}"
    try:
        second = run(_SECOND[0], **_SECOND[1])
    except HybridsimError as error:
        return Reference(
            title, best, None, (f"no second reference with {_describe(_SECOND)}: {error.message}",)
        )
    if not second.success:
        reason = f"{second.status}: {second.message}"
        return Reference(title, best, None, (f"no second reference with {_describe(_SECOND)}: {reason}",))
    uncertainty = best.measure(trajectory_of(second))
    warnings: tuple[str, ...] = ()
    if not uncertainty.sequence.right:
        warnings = (f"the two reference runs differ in their modes: {uncertainty.sequence}",)
    return Reference(f"{title}, against {_describe(_SECOND)}", best, uncertainty, warnings)


def _describe(run: tuple[str, Mapping[str, Any]]) -> str:
    name, options = run
    return f"{name} at " + ", ".join(f"{key} {value:g}" for key, value in options.items())
