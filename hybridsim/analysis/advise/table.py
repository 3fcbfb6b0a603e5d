"""This module writes an advice as text."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from hybridsim.analysis.advise.ladder import FULL, WITHOUT_TRIAL, duration
from hybridsim.errors import printable
from hybridsim.presentation.readable import aligned

if TYPE_CHECKING:
    from hybridsim.analysis.advise.advice import Advice
    from hybridsim.analysis.advise.ladder import Step


def table(advice: Advice) -> str:
    """Return heading, known properties, simplified models, settings and remarks as text."""
    lines = [f"{advice.quantity} of {advice.model.name} within {advice.tol:g}: {_conclusion(advice)}"]
    lines += [f"  by theory: {text}" for text in advice.certificates]
    lines += ["", *aligned(_ladder(advice))]
    if advice.settings:
        lines += ["", *aligned(_settings(advice))]
    if advice.spread is not None:
        lines += ["", _spread(advice)]
    if advice.remarks:
        lines += ["", *advice.remarks]
    return printable("\n".join(lines))


def _conclusion(advice: Advice) -> str:
    if advice.region is not None:
        return f"over {advice.region.status.size} points of {', '.join(advice.region.axes)}"
    simplest, setting = advice.simplest, advice.integrator
    how = f"; run the full model by {setting.title}" if setting is not None else ""
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
