"""This module runs regularised forms of a model and compares them with the set-valued law."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from hybridsim.analysis.compare.lines import Series
from hybridsim.analysis.compare.rows import Row
from hybridsim.arguments import known_name
from hybridsim.errors import UsageError
from hybridsim.model import Model
from hybridsim.model.smoothing.regularize import KINDS
from hybridsim.reference.trajectory import EventLike, ExactEvent, Trajectory

# A stiff and an explicit method, because the cost of a small v0 differs between them.
INTEGRATORS = ("cvode-bdf", "dop853")
# Tight enough that the error of the method is small compared with that of the form.
RTOLS = (1e-9,)
# Of the velocity's nominal size: from a visible error to thousands of steps per period.
FRACTIONS = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4)
# The exponents hold for small v0 and are fitted to the last decade. Errors within this factor of the method's
# own error are left out.
_FITTED, _CLEAR = 3, 3.0

# Modes of Karnopp's form that count as slip: broken loose, but still inside the dead band.
_BREAKING = {"break+": "slip+", "break-": "slip-"}
_SMOOTH = "smooth"


def regularised_series(
    model: Model,
    kinds: Sequence[str],
    v0: Sequence[float] | None = None,
    integrators: Sequence[str] | None = None,
    rtols: Sequence[float] | None = None,
) -> tuple[Series, ...]:
    """Return series of runs with decreasing width v0 for each regularised law, and runs with the set-valued law.

    Parameters
    ----------
    kinds : kinds of `Model.regularized`.
    v0 : widths, in the unit of the relative velocity; by default fractions of its nominal size.
    """
    if not model.contacts:
        raise UsageError(
            f"model {model.name} has no contact to regularise", remedy="choose a model with dry friction"
        )
    for kind in kinds:
        known_name(kind, KINDS, "`regularized` cannot contain", "forms")
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
    """Return the smallest nominal relative velocity of all contacts."""
    nominal = {state.name: state.nominal or 1.0 for state in model.states}
    sizes = [
        [nominal[name] for name in contact.velocity.names if name in nominal] for contact in model.contacts
    ]
    return min(max(size, default=1.0) for size in sizes)


def as_set_valued(run: Trajectory, contacts: Collection[str]) -> Trajectory:
    """Return a run of a regularised model; its modes get the names that they have in the set-valued law."""
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


def exponents(rows: Sequence[Row]) -> Mapping[str, tuple[float | None, float | None]]:
    """Return the exponents p of error ~ v0^p and of work ~ v0^p for each series; an unknown exponent is None.

    They are fitted by least squares of the logarithms over the three smallest v0 that ran. For the error only
    those count whose error is at least three times that of the same integrator on the set-valued law at the
    same tolerance. Work is counted in evaluations, which are the same on every machine.
    """
    own = {(row.integrator, row.setting[1]): row.errors.state for row in rows if not row.form and row.errors}
    found = {}
    for label in dict.fromkeys(row.label for row in rows):
        points = [
            (
                row.setting[1],
                row.errors.state,
                row.cost.work,
                own.get((row.integrator, row.options["rtol"]), 0.0),
            )
            for row in rows
            if row.label == label and row.form and row.errors and row.cost
        ]
        if points:
            errors = [(v0, error) for v0, error, _, least in points if error > _CLEAR * least]
            found[label] = (_exponent(errors), _exponent([(v0, work) for v0, _, work, _ in points]))
    return found


def exponent_text(power: float | None) -> str:
    """Return an exponent as text with two decimals."""
    return "?" if power is None else f"{round(power, 2) + 0.0:.2f}"  # so that -0.001 becomes 0.00


def _exponent(points: Sequence[tuple[float, float]]) -> float | None:
    chosen = sorted(points)[:_FITTED]
    if len(chosen) < _FITTED or not min(y for _, y in chosen) > 0:
        return None
    x, y = np.log(chosen).T
    return float(np.polyfit(x, y, 1)[0])
