"""This module writes a sweep as text: extremes of its results, and counts of statuses."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from hybridsim.errors import printable
from hybridsim.presentation.readable import aligned

if TYPE_CHECKING:
    from hybridsim.analysis.sweep.result import Sweep

_SHOWN = 5  # number of statuses that are shown


def heading(sweep: Sweep) -> str:
    """Return the model, the axes and the names of the results in one line."""
    shape = " x ".join(f"{len(values)} {name}" for name, values in sweep.axes.items())
    return f"Sweep of {sweep.model.name} over {shape}: {', '.join(sweep.values) or 'nothing'}"


def statuses(sweep: Sweep) -> list[str]:
    """Return the number of points per status, one line each."""
    counted = Counter(sweep.status.ravel().tolist()).most_common()
    lines = [f"  {count} of {sweep.status.size} points: {text}" for text, count in counted[:_SHOWN]]
    return lines + ([f"  ... and {len(counted) - _SHOWN} other statuses"] if len(counted) > _SHOWN else [])


def table(sweep: Sweep) -> str:
    """Return the extremes of each result and the points at which they occur; for texts, the counts."""
    rows: list[tuple[str, ...]] = []
    for name, values in sweep.values.items():
        unit = sweep.units.get(name, "")
        if values.dtype.hasobject:
            counted = Counter(text for text in values.ravel().tolist() if text != "").most_common(_SHOWN)
            rows.append((name, ", ".join(f"{text} {count}" for text, count in counted), "", unit))
            continue
        numbers = np.abs(values) if np.iscomplexobj(values) else values
        if np.isfinite(numbers).any():
            low, high = (int(find(numbers)) for find in (np.nanargmin, np.nanargmax))
            ends = [f"{numbers.ravel()[k]:.6g} at {_where(sweep, k, values.shape)}" for k in (low, high)]
            shown = f"|{name}|" if np.iscomplexobj(values) else name
            rows.append((shown, *ends, unit))
    header = ("reading", "least", "greatest", "unit")
    lines = aligned([header, *rows])
    head = [heading(sweep), *statuses(sweep)]
    return printable("\n".join([*head, "", *lines] if rows else head))


def _where(sweep: Sweep, k: int, shape: tuple[int, ...]) -> str:
    """Return the parameters of the point at which the k-th value of a result was computed."""
    place = np.unravel_index(k, shape)
    if sweep.mode == "list":
        return ", ".join(_set(name, settings[place[0]]) for name, settings in sweep.axes.items())
    return ", ".join(_set(name, settings[i]) for (name, settings), i in zip(sweep.axes.items(), place))


def _set(name: str, value: object) -> str:
    return f"{name}={value:.6g}" if isinstance(value, float) else f"{name}={value}"
