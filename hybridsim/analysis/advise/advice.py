"""This module defines the result of `advise`: compared models, and the simplest adequate one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from hybridsim.analysis.advise.ladder import FULL, WHERE_TRIED, WITHOUT_TRIAL, Step, duration
from hybridsim.analysis.advise.question import Number
from hybridsim.analysis.advise.settings import Setting
from hybridsim.analysis.advise.uncertainty import Spread
from hybridsim.analysis.provenance import provenance
from hybridsim.analysis.sweep import Sweep
from hybridsim.arguments import known_name
from hybridsim.errors import UsageError, printable
from hybridsim.files import json_record
from hybridsim.model import Model
from hybridsim.presentation.readable import Readable, aligned


@dataclass(frozen=True, eq=False)
class Advice(Readable):
    """The simplest model that answers a question within a tolerance, with the evidence for it.

    Parameters
    ----------
    model, quantity, tol : object
        The question.
    value : float
        The value of the full model; nan for a region.
    ladder : tuple of Step
        A `Step` for each rung from the simplest up, the full model last. Over a region ``value`` and
        ``seconds`` of a step are not numbers, ``error`` is the largest of the region and ``why`` counts
        points.
    certificates : tuple of str, optional
        Statements that theory makes without a run.
    settings : tuple of Setting, optional
        Integrator settings that were tried for the full model; the quickest adequate one first.
    spread : Spread, optional
        The effect of the given parameter ranges on the quantity.
    region : Sweep, optional
        A `Sweep` with, at each point, ``simplest`` (a name), its ``error``, the ``value`` of the full model
        and the ``errors`` of all rungs (inf if a rung does not apply, or was not tried because a simpler one
        is adequate).
    left_out : str, optional
        A sentence about the work that did not fit into the budget.
    seconds : float, optional
        The total time.

    Examples
    --------
    >>> import hybridsim as hs
    >>> found = hs.advise("dfcs", "amplitude.x", 0.03, params={"F0": 100}, rungs=["no-friction"], integrators=False)
    >>> [step.name for step in found.ladder]
    ['no-friction', 'full model']
    """

    model: Model
    quantity: str
    tol: float
    value: Number
    ladder: tuple[Step, ...]
    certificates: tuple[str, ...] = ()
    settings: tuple[Setting, ...] = ()
    spread: Spread | None = None
    region: Sweep | None = None
    left_out: str = ""
    seconds: float = math.nan

    @property
    def simplest(self) -> Step:
        """The simplest adequate model, or else the full model. In a region, a model must be adequate at every point."""
        return next(step for step in self.ladder if step.is_adequate)

    @property
    def integrator(self) -> Setting | None:
        """The fastest integrator setting within the tolerance, or None if no setting was found."""
        return next((s for s in self.settings if s.is_adequate), None)

    def __getitem__(self, name: str) -> Step:
        """Return the simplified model with this name."""
        steps = {step.name: step for step in self.ladder}
        return steps[known_name(name, list(steps), "the advice has no simpler model", "rungs")]

    @property
    def map(self) -> np.ndarray:
        """The name of the simplest adequate model at each point of a region."""
        if self.region is None:
            raise UsageError(
                "this advice is for a single point, so it has no `map`",
                remedy="pass `over`, such as over={'F0': [20, 30]}, to compute a map",
            )
        return self.region["simplest"]

    @property
    def remarks(self) -> tuple[str, ...]:
        """Further findings, with one sentence per finding."""
        return tuple(_remarks(self))

    def __repr__(self) -> str:
        return self.table()

    def table(self) -> str:
        """Return the compared models, the integrator settings and the remarks as text."""
        lines = [f"{self.quantity} of {self.model.name} within {self.tol:g}: {_conclusion(self)}"]
        lines += [f"  by theory: {text}" for text in self.certificates]
        lines += ["", *aligned(_ladder(self))]
        if self.settings:
            lines += ["", *aligned(_settings(self))]
        if self.spread is not None:
            lines += ["", _spread(self)]
        if self.remarks:
            lines += ["", *self.remarks]
        return printable("\n".join(lines))

    def to_dict(self) -> dict[str, Any]:
        """Return all results as plain Python values; None replaces NaN and infinity."""
        return {
            "model": self.model.name,
            "quantity": self.quantity,
            "tol": self.tol,
            "value": _plain(self.value),
            "simplest": self.simplest.name,
            "integrator": None if self.integrator is None else self.integrator.title,
            "ladder": [_fields(s, "name title drops value error seconds verdict why") for s in self.ladder],
            "settings": [
                {
                    **_fields(s, "integrator value error seconds verdict is_adequate why"),
                    "options": dict(s.options),
                }
                for s in self.settings
            ],
            "certificates": list(self.certificates),
            "spread": None if self.spread is None else _fields(self.spread, "ranges low high relative"),
            "remarks": list(self.remarks),
            "region": None if self.region is None else self._region(),
            "seconds": _plain(self.seconds),
            "provenance": provenance(self.model),
        }

    def _region(self) -> dict[str, Any]:
        assert self.region is not None
        found = self.region.to_dict()
        errors = self.region["errors"].astype(object)
        errors[~np.isfinite(self.region["errors"])] = None
        found["values"]["errors"] = errors.tolist()
        return {name: found[name] for name in ("mode", "dimensions", "axes", "values", "status", "units")}

    def to_json(self, path: str | Path | None = None) -> str:
        """Return all results as JSON text, with versions, machine and model hash. With a path, also write the text."""
        return json_record(self.to_dict(), path)

    def plot(self) -> Any:
        """Draw the errors of the compared models, or the map of a region; see `hybridsim.plot.advice`."""
        # The plot package is a layer above this one, so it is imported only on demand.
        return import_module("hybridsim.plot").advice(self)


def _remarks(advice: Advice) -> list[str]:
    found = [advice.left_out] if advice.left_out else []
    simplest, full = advice.simplest, advice.ladder[-1]
    where = " everywhere in the region" if advice.region is not None else ""
    if all(step.verdict in (*WITHOUT_TRIAL, FULL) for step in advice.ladder):
        found.append("no simpler model could be tried: none applies to this model")
    elif untried := [step.name for step in advice.ladder if step.verdict == WHERE_TRIED]:
        found.append(
            f"the map gives the simplest model at each point; whether {' or '.join(untried)} would be adequate at all "
            f"of them was not tried; pass rungs=[{untried[-1]!r}] to try it"
        )
    elif simplest.verdict == FULL and len(advice.ladder) > 1:
        found.append(f"no simpler model gives {advice.quantity} within {advice.tol:g}{where}")
    elif simplest.seconds > full.seconds:
        found.append(
            f"{simplest.name} is simpler but not faster: it takes {duration(simplest.seconds)}, "
            f"the full model {duration(full.seconds)}"
        )
    spread = advice.spread
    if spread is not None and spread.relative > advice.tol:
        found.append(
            f"uncertain parameters alone change {advice.quantity} by {100.0 * spread.relative:.3g} %, more "
            f"than the tolerance {advice.tol:g}: a more detailed model does not help"
        )
        enough = next(s for s in advice.ladder if s.error <= spread.relative or s.verdict == FULL)
        if spread.relative >= 1.0:
            found.append("this is more than the value itself: measure the parameters better first")
        elif enough is not simplest:
            found.append(f"within that spread {enough.name} is enough (error {enough.error:.2g})")
    if advice.settings and advice.integrator is None:
        found.append("no integrator setting that was tried is within the tolerance")
    if advice.region is not None and advice.region.failed.any():
        found.append(
            f"{int(advice.region.failed.sum())} of {advice.region.failed.size} points have no answer"
        )
    return found


def _fields(item: Any, names: str) -> dict[str, Any]:
    return {name: _plain(getattr(item, name)) for name in names.split()}


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: list(ends) for name, ends in value.items()}
    if isinstance(value, complex):
        return {"real": value.real, "imaginary": value.imag}
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value


def _conclusion(advice: Advice) -> str:
    if advice.region is not None:
        return f"over {advice.region.status.size} points of {', '.join(advice.region.axes)}"
    simplest, setting = advice.simplest, advice.integrator
    how = f"; the full model runs fastest by {setting.title}" if setting is not None else ""
    if all(step.verdict in (*WITHOUT_TRIAL, FULL) for step in advice.ladder):
        return f"no simpler model could be tried, so the full model is needed{how}"
    if simplest.verdict == FULL:
        return f"the full model is needed{how}"
    return f"{simplest.title} is enough{how}"


def _ladder(advice: Advice) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [("rung", "value", "error", "cost", "verdict", "why")]
    return rows + [_row(step) for step in advice.ladder]


def _row(step: Step) -> tuple[str, ...]:
    value = "" if step.value is None or _is_nan(step.value) else f"{step.value:.7g}"
    error = "" if step.verdict in WITHOUT_TRIAL or step.value is None else f"{step.error:.2e}"
    return (step.name, value, error, _cost(step.seconds), step.verdict, step.why)


def _settings(advice: Advice) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [("full model by", "value", "error", "cost", "verdict", "why")]
    for s in advice.settings:
        value = "" if s.value is None else f"{s.value:.7g}"
        error = "" if s.value is None else f"{s.error:.2e}"
        rows.append((s.title, value, error, _cost(s.seconds), s.verdict, s.why))
    return rows


def _spread(advice: Advice) -> str:
    spread = advice.spread
    assert spread is not None
    ranges = ", ".join(f"{name} in [{low:g}, {high:g}]" for name, (low, high) in spread.ranges.items())
    return f"with {ranges}, at the ends: {spread.low:.7g} to {spread.high:.7g}, +-{spread.relative:.2g} of the value"


def _cost(seconds: float) -> str:
    if math.isnan(seconds):
        return ""
    return duration(seconds)


def _is_nan(value: float | complex) -> bool:
    return value != value
