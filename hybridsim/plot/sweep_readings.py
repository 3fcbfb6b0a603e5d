"""Which readings of a sweep can be drawn, with their units and where there is none."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hybridsim.errors import UsageError
from hybridsim.plot.scale import label_axis
from hybridsim.plot.style import literal

if TYPE_CHECKING:
    from matplotlib.axis import Axis

    from hybridsim.analysis import Sweep

_MOST = 6  # panels that fit a page
_RATHER = (
    "amplitude",
    "stick_fraction",
    "stops_per_period",
    "dissipated",
)  # than others, where not all are drawn
NO_RESULT = "no result"


def chosen_names(result: Sweep, names: Sequence[str], arrays: bool) -> tuple[str, ...]:
    """Readings that are asked for, else those that people ask for first; arrays only where they can be drawn.

    Raises
    ------
    UsageError
        For names that do not exist, and readings that cannot be drawn.
    """
    kept = [name for name in result.values if _drawable(result, name, arrays)]
    for name in names:
        if result[name] is not None and name not in kept:
            what = "texts" if result[name].dtype.hasobject else "an array at each point"
            raise UsageError(f"{name} is {what}, which cannot be drawn", remedy=f"draw one of {kept}")
    found = tuple(names) or _first_asked_for(kept)
    if not found:
        raise UsageError("the sweep holds nothing that can be drawn", remedy="see its status for what failed")
    return found


def _first_asked_for(kept: Sequence[str]) -> tuple[str, ...]:
    """As many as fit a page, one of each of the kinds above before a second; in the order of the sweep."""

    def rank(name: str) -> tuple[int, int]:
        kind = name.partition(".")[0]
        before = [other for other in kept[: kept.index(name)] if other.partition(".")[0] == kind]
        return len(before) if kind in _RATHER else len(kept), kept.index(name)

    chosen = sorted(kept, key=rank)[:_MOST]
    return tuple(name for name in kept if name in chosen)


def not_drawn(result: Sweep, arrays: bool) -> tuple[str, ...]:
    """Readings that could be drawn and are not, unless they are asked for by name."""
    kept = [name for name in result.values if _drawable(result, name, arrays)]
    return tuple(name for name in kept if name not in _first_asked_for(kept))


def _drawable(result: Sweep, name: str, arrays: bool) -> bool:
    values = result[name]
    return values.dtype.kind in "fc" and (arrays or values.ndim == result.status.ndim)


def numbers_of(result: Sweep, name: str) -> np.ndarray:
    """A reading as real numbers: the modulus of what is complex."""
    values = result[name]
    return np.abs(values) if np.iscomplexobj(values) else values


def range_of(values: np.ndarray) -> tuple[float, float]:
    """Least and largest number, (0, 0) where there is none."""
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)


def label_of(result: Sweep, name: str) -> str:
    """Name of a reading as it is written at an axis."""
    return f"|{name}|" if np.iscomplexobj(result[name]) else name


def positions(values: np.ndarray) -> np.ndarray:
    """Where the values of a parameter stand along an axis; texts one after the other."""
    return values if values.dtype.kind == "f" else np.arange(float(len(values)))


def label_parameter(axis: Axis, result: Sweep, name: str) -> None:
    """Label an axis with a parameter and its unit, or with its texts."""
    values = result.axes[name]
    if values.dtype.kind == "f":
        label_axis(axis, name, result.units.get(name, ""), *range_of(values))
    else:
        axis.set_ticks(np.arange(len(values)), [literal(str(value)) for value in values])
        axis.set_label_text(literal(name))


def setting(result: Sweep, name: str, value: object) -> str:
    """One value of a parameter in words: "N = 40 N"."""
    number = f"{value:.6g}" if isinstance(value, float) else str(value)
    return literal(f"{name} = {number} {result.units.get(name, '')}".rstrip())


def title_of(result: Sweep) -> str:
    """What a picture of a sweep is headed by."""
    return result.model.title or result.model.name
