"""Lines that run a regularised form of a model, and how such a run is held against the set-valued law."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hybridsim.analysis.series import Series
from hybridsim.analysis.trajectory import EventLike, ExactEvent, Trajectory
from hybridsim.errors import UsageError, nearest
from hybridsim.model.regularize import KINDS

if TYPE_CHECKING:
    from hybridsim.analysis.comparison import Comparison
    from hybridsim.model import Model

# A stiff method and an explicit one: which of them pays for a small v0, and how, is half of the question.
INTEGRATORS = ("cvode-bdf", "dop853")
# Tight enough that the error of the method does not show beside that of the form.
RTOLS = (1e-9,)
# Of the velocity's nominal size: from a form that one sees to one whose steps are counted in thousands a period.
FRACTIONS = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4)
# The exponent is that for small v0: of the last decade. Closer than this to the error of the method itself, the error
# of the form is no longer seen alone.
_FITTED, _CLEAR = 3, 3.0

# Modes of Karnopp's form that the set-valued law calls slip: broken loose, and not yet out of the dead band.
_BREAKING = {"break+": "slip+", "break-": "slip-"}
_SMOOTH = "smooth"


def regularised_series(
    model: Model,
    kinds: Sequence[str],
    v0: Sequence[float] | None = None,
    integrators: Sequence[str] | None = None,
    rtols: Sequence[float] | None = None,
) -> tuple[Series, ...]:
    """For each integrator and tolerance the set-valued law as it is, then each regularised form over the values of v0.

    Parameters
    ----------
    kinds : of `Model.regularized`.
    v0 : widths, in the unit of the relative velocity; fractions of its nominal size if not given.
    """
    if not model.contacts:
        raise UsageError(
            f"model {model.name} has no contact to regularise", remedy="choose one with dry friction"
        )
    for kind in kinds:
        if kind not in KINDS:
            raise UsageError(
                f"there is no regularisation {kind!r}", remedy=nearest(kind, KINDS, kind="forms")
            )
    widths = tuple(v0) if v0 else tuple(fraction * _velocity_size(model) for fraction in FRACTIONS)
    chosen = [(name, float(rtol)) for name in integrators or INTEGRATORS for rtol in rtols or RTOLS]
    many = len(rtols or RTOLS) > 1

    def label(form: str, name: str, rtol: float) -> str:
        return f"{form}, {name}" + (f", rtol {rtol:g}" if many else "")

    lines = [Series(name, "rtol", (rtol,), label=label("set-valued", name, rtol)) for name, rtol in chosen]
    for kind in kinds:
        lines += [
            Series(name, "v0", widths, {"rtol": rtol}, label(kind, name, rtol), regularized=kind)
            for name, rtol in chosen
        ]
    return tuple(lines)


def _velocity_size(model: Model) -> float:
    """Nominal size of the relative velocities: the smallest of the contacts."""
    nominal = {state.name: state.nominal or 1.0 for state in model.states}
    sizes = [
        [nominal[name] for name in contact.velocity.names if name in nominal] for contact in model.contacts
    ]
    return min(max(size, default=1.0) for size in sizes)


def as_set_valued(run: Trajectory, contacts: Collection[str]) -> Trajectory:
    """A run of a regularised form in the words of the set-valued law; a contact without modes has none to judge."""
    modes = {
        name: _BREAKING.get(mode, mode) if name in contacts else mode
        for name, mode in run.initial_modes.items()
        if not (name in contacts and mode == _SMOOTH)
    }
    events: list[EventLike] = []
    for event in run.events:
        if event.kind == "transition" and event.component in contacts:
            source, target = (_BREAKING.get(mode, mode) for mode in (event.source, event.target))
            if source != target:
                events.append(ExactEvent(event.t, event.component, source, target))
        else:
            events.append(event)
    return replace(run, events=tuple(events), initial_modes=modes)


def exponents(comparison: Comparison) -> Mapping[str, tuple[float | None, float | None]]:
    """For each line over v0 the exponents p of error ~ v0^p and of work ~ v0^p as v0 falls; None if unknown.

    Fitted by least squares of the logarithms over the three smallest v0 that ran; for the error, over those where it
    is at least three times the one that the same integrator makes on the set-valued law at the same tolerance. Work
    is counted in evaluations, which are the same on every machine.
    """
    own = {
        (row.integrator, row.setting[1]): row.errors.state
        for row in comparison.rows
        if not row.form and row.errors
    }
    found = {}
    for label in comparison.labels:
        rows = [row for row in comparison.rows if row.label == label and row.form]
        points = [
            (
                row.setting[1],
                row.errors.state,
                row.cost.work,
                own.get((row.integrator, row.options["rtol"]), 0.0),
            )
            for row in rows
            if row.errors and row.cost
        ]
        if points:
            errors = [(v0, error) for v0, error, _, least in points if error > _CLEAR * least]
            found[label] = (_exponent(errors), _exponent([(v0, work) for v0, _, work, _ in points]))
    return found


def exponent_text(power: float | None) -> str:
    """An exponent with two decimals."""
    return "?" if power is None else f"{round(power, 2) + 0.0:.2f}"  # -0.001 is 0.00


def _exponent(points: Sequence[tuple[float, float]]) -> float | None:
    chosen = sorted(points)[:_FITTED]
    if len(chosen) < _FITTED or not min(y for _, y in chosen) > 0:
        return None
    x, y = np.log(chosen).T
    return float(np.polyfit(x, y, 1)[0])
