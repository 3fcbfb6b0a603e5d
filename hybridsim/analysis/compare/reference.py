"""This module computes the reference of a comparison, and the uncertainty of the reference."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from hybridsim.analysis.compare.errors_against_reference import Errors, Yardstick
from hybridsim.analysis.compare.resets import resets_of
from hybridsim.analysis.compare.trajectory import as_trajectory, trajectory_of
from hybridsim.analysis.time_budget import OutOfTime, TimeBudget
from hybridsim.arguments import cannot_be
from hybridsim.errors import HybridsimError, SimulationError, UsageError
from hybridsim.model import Model
from hybridsim.reference.closed_forms import find_closed_form
from hybridsim.reference.trajectory import Trajectory
from hybridsim.solution import Solution


class _TooLong(SimulationError):
    """Raised when the run of a reference has passed its time limit."""


Run = Callable[..., "Solution"]
"""The type of a function that runs the model over the span: (integrator, **options) -> Solution."""

CLOSED_FORM, MULTIPLE_PRECISION, RUNS = "closed form", "multiple precision", "runs"
KINDS = (CLOSED_FORM, MULTIPLE_PRECISION, RUNS)
# The most accurate integrator, near the tightest tolerance possible in double precision.
_BEST: tuple[str, Mapping[str, Any]] = ("dop853", {"rtol": 1e-13})
# Two methods of different kinds: one-step with our event location, and multistep with SUNDIALS' own.
_FIRST: tuple[str, Mapping[str, Any]] = ("scipy-dop853", {"rtol": 1e-13})
_SECOND: tuple[str, Mapping[str, Any]] = ("cvode-adams", {"rtol": 1e-12})
# Two more, for a model on which these take too long, because it may be stiff.
_STIFF: tuple[str, Mapping[str, Any]] = ("rodas5p", {"rtol": 1e-10})
_SECOND_STIFF: tuple[str, Mapping[str, Any]] = ("cvode-bdf", {"rtol": 1e-10})
DIGITS = 32


@dataclass(frozen=True)
class Reference:
    """The reference trajectory of a comparison, and its uncertainty.

    Parameters
    ----------
    title : its description.
    yardstick : measures runs against it.
    uncertainty : the estimated error of the reference; None if unknown.
    warnings : reasons for doubt.
    second : the description of a reference of another kind; "" without one.
    difference : the distance of the second from this one; None without one.
    """

    title: str
    yardstick: Yardstick
    uncertainty: Errors | None
    warnings: tuple[str, ...] = ()
    second: str = ""
    difference: Errors | None = None


def find_reference(
    model: Model,
    t_span: tuple[float, float],
    period: float | None,
    run: Run,
    requested: Any = None,
    progress: Callable[[float], None] | None = None,
    seconds: float = math.inf,
) -> Reference:
    """Find the reference of a comparison.

    Parameters
    ----------
    requested : None for a closed form if one is known, else two runs; "closed form", "multiple precision" or
    "runs" to require that kind; several of these for the first one available; or the reference itself: a
    Solution, a Trajectory, or a function of times (k,) that returns states (n, k).
    run : runs the model with an integrator and its options.
    progress : called with the finished fraction of a reference in multiple precision.
    seconds : the time limit of each run; if the first of two takes longer, two stiff methods replace them.

    A closed form and a multiple-precision run are independent of the engine; as a check they are compared
    with the most accurate integrator. With two runs the first is the reference, and the distance of the
    second its uncertainty. Both follow the engine's decisions at events, so that an error in these decisions
    would not show.
    """

    def yardstick(trajectory: Trajectory) -> Yardstick:
        nominal = [state.nominal or 1.0 for state in model.states]
        return Yardstick(trajectory, resets_of(model), nominal, period)

    def timed(integrator: str, **options: Any) -> Solution:
        try:
            return run(integrator, **options, progress=TimeBudget(seconds))
        except OutOfTime as timeout:
            raise _TooLong(
                f"the run with {_describe((integrator, options))} was {timeout}",
                remedy="shorten the span, pass a larger `budget` or a `reference`",
            ) from None

    if requested is None:
        kinds: tuple[str, ...] = (CLOSED_FORM, RUNS)
    elif isinstance(requested, str | tuple):
        kinds = (requested,) if isinstance(requested, str) else requested
    else:
        return Reference("given by the caller", yardstick(as_trajectory(requested, t_span)), None)
    refusal: UsageError | None = None
    for kind in kinds:
        if kind not in KINDS:
            raise cannot_be("reference", kind, f"use one of {', '.join(map(repr, KINDS))}")
        try:
            if kind == CLOSED_FORM:
                return _checked(_closed_form(model, t_span, yardstick), timed)
            if kind == MULTIPLE_PRECISION:
                return _checked(_multiple_precision(model, t_span, yardstick, progress), timed)
            return _two_runs(timed, yardstick)
        except UsageError as error:
            refusal = refusal or error
    assert refusal is not None
    raise refusal


def _closed_form(
    model: Model, t_span: tuple[float, float], yardstick: Callable[[Trajectory], Yardstick]
) -> Reference:
    closed = find_closed_form(model, t_span)
    if closed is None:
        raise UsageError(f"no closed form is known for {model.name}", remedy=f"use reference={RUNS!r}")
    exact = yardstick(closed.exact)
    return Reference(closed.title, exact, exact.measure(closed.nudged))


def _multiple_precision(
    model: Model,
    t_span: tuple[float, float],
    yardstick: Callable[[Trajectory], Yardstick],
    progress: Callable[[float], None] | None,
) -> Reference:
    from hybridsim.reference.multiple_precision import multiple_precision_trajectory

    motion = multiple_precision_trajectory(model, t_span, digits=DIGITS, progress=progress)
    return Reference(f"Taylor series in multiple precision, {DIGITS} digits", yardstick(motion), None)


def _checked(reference: Reference, run: Run) -> Reference:
    """Return the reference with its uncertainty, estimated from a run of the most accurate integrator."""
    difference, warnings = _held_against(reference.yardstick, run, _BEST)
    return replace(
        reference,
        warnings=reference.warnings + warnings,
        second=f"run with {_describe(_BEST)}" if difference else "",
        difference=difference,
    )


def _two_runs(run: Run, yardstick: Callable[[Trajectory], Yardstick]) -> Reference:
    chosen, other, late = _FIRST, _SECOND, ""
    try:
        first = run(chosen[0], **chosen[1])
    except _TooLong as error:
        chosen, other, late = _STIFF, _SECOND_STIFF, error.message
        first = run(chosen[0], **chosen[1])
    if not first.success:
        raise SimulationError(
            f"the reference run with {_describe(chosen)} ended as {first.status}: {first.message}",
            remedy="shorten the span, or pass a `reference`",
        )
    best = yardstick(trajectory_of(first))
    difference, warnings = _held_against(best, run, other)
    warnings = (late, *warnings) if late else warnings
    second = f"run with {_describe(other)}" if difference else ""
    return Reference(f"run with {_describe(chosen)}", best, difference, warnings, second, difference)


def _held_against(
    best: Yardstick, run: Run, second: tuple[str, Mapping[str, Any]]
) -> tuple[Errors | None, tuple[str, ...]]:
    """Return the distance of a second reference from the best reference, and warnings about the distance."""
    try:
        solution = run(second[0], **second[1])
    except HybridsimError as error:
        return None, (f"no second reference with {_describe(second)}: {error.message}",)
    if not solution.success:
        return None, (f"no second reference with {_describe(second)}: {solution.status}: {solution.message}",)
    difference = best.measure(trajectory_of(solution))
    if difference.wrong_modes:
        return difference, (f"the two references differ in their modes: {difference.sequence}",)
    return difference, ()


def _describe(run: tuple[str, Mapping[str, Any]]) -> str:
    name, options = run
    return f"{name} at " + ", ".join(f"{key} {value:g}" for key, value in options.items())
