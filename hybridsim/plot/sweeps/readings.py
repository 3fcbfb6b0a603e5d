"""This module selects the results of a sweep that can be drawn, with their units and missing values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import QuadMesh

from hybridsim.errors import UsageError
from hybridsim.plot.shared import style
from hybridsim.plot.shared.scale import label_axis
from hybridsim.plot.shared.style import literal
from hybridsim.plot.shared.symbols import symbol_of, unit_text

if TYPE_CHECKING:
    from hybridsim.analysis import Sweep

_ROUNDING, _MARGIN = 1e-9, 0.1  # of a value: differences that are noise, and the range that is shown instead
_MAX_PANELS = 6  # panels that fit on a page
_RATHER = (
    "amplitude",
    "stick_fraction",
    "stops_per_period",
    "dissipated",
)  # preferred if not all can be drawn
NO_RESULT = "no result"
NO_COLOUR = "#d8d8d8"  # grey for points without a result, which no scale of colours contains


def chosen_names(result: Sweep, names: Sequence[str], arrays: bool) -> tuple[str, ...]:
    """Return the names of the requested results of a sweep, by default the most common results.

    Raises
    ------
    UsageError
        For unknown names, or readings that cannot be drawn.
    """
    drawable = [name for name in result.values if _drawable(result, name, arrays)]
    for name in names:
        if result[name] is not None and name not in drawable:
            content = "text" if result[name].dtype.hasobject else "an array at each point"
            raise UsageError(f"{name} is {content}, which cannot be drawn", remedy=f"draw one of {drawable}")
    found = tuple(names) or _first_asked_for(drawable)
    if not found:
        raise UsageError(
            "no result of the sweep can be drawn", remedy="the status of each point gives the reason"
        )
    return found


def _first_asked_for(drawable: Sequence[str]) -> tuple[str, ...]:
    """Return the names of up to six results: first one result of each common kind, then other results."""

    def rank(name: str) -> tuple[int, int]:
        kind = name.partition(".")[0]
        before = [other for other in drawable[: drawable.index(name)] if other.partition(".")[0] == kind]
        return len(before) if kind in _RATHER else len(drawable), drawable.index(name)

    chosen = sorted(drawable, key=rank)[:_MAX_PANELS]
    return tuple(name for name in drawable if name in chosen)


def not_drawn(result: Sweep, arrays: bool) -> tuple[str, ...]:
    """Return the names of the results of a sweep that are drawn only on request."""
    drawable = [name for name in result.values if _drawable(result, name, arrays)]
    return tuple(name for name in drawable if name not in _first_asked_for(drawable))


def _drawable(result: Sweep, name: str, arrays: bool) -> bool:
    values = result[name]
    return values.dtype.kind in "fc" and (arrays or values.ndim == result.status.ndim)


def numbers_of(result: Sweep, name: str) -> np.ndarray:
    """Return the values of one result of a sweep as real numbers; complex numbers become their modulus."""
    values = result[name]
    return np.abs(values) if np.iscomplexobj(values) else values


def range_of(values: np.ndarray) -> tuple[float, float]:
    """Return the least and the largest finite number, or (0, 0) if there are none."""
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)


def label_of(result: Sweep, name: str) -> str:
    """Return a result of a sweep as an axis label, such as "amplitude of x" for amplitude.x."""
    kind, _, whose = name.partition(".")
    kind = "dissipated energy" if kind == "dissipated" else kind.replace("_", " ")
    text = f"{kind} of {whose}" if whose else name
    return f"|{text}|" if np.iscomplexobj(result[name]) else text


def show_range(axis: Axis, values: np.ndarray) -> None:
    """Widen the range of an axis if all values are equal within rounding, so that no noise is enlarged."""
    low, high = range_of(values)
    size = max(abs(low), abs(high))
    if high - low <= _ROUNDING * size:
        axis.set_view_interval(low - (_MARGIN * size or 1.0), high + (_MARGIN * size or 1.0), ignore=True)


def positions(values: np.ndarray) -> np.ndarray:
    """Return the axis positions of the values of a parameter; values that are texts get whole numbers."""
    return values if values.dtype.kind == "f" else np.arange(float(len(values)))


def label_parameter(axis: Axis, result: Sweep, name: str) -> None:
    """Label an axis with the name and unit of a parameter, or with its text values."""
    values = result.axes[name]
    if values.dtype.kind == "f":
        label_axis(axis, name, result.units.get(name, ""), *range_of(values))
    else:
        axis.set_ticks(np.arange(len(values)), [literal(str(value)) for value in values])
        axis.set_label_text(symbol_of(name))


def label_result(axis: Axis, result: Sweep, name: str, values: np.ndarray) -> None:
    """Label an axis with the name and unit of a result."""
    label = label_of(result, name)
    symbol, title = ("", label) if " " in label else (label, "")
    label_axis(axis, symbol, result.units.get(name, ""), *range_of(values), title=title)


def draw_map(panel: Axes, result: Sweep, values: np.ndarray, **colours: Any) -> QuadMesh:
    """Draw a value for each point of two parameters: the first parameter is vertical, the second is horizontal."""
    coordinates = []
    for dimension, parameter in enumerate(result.axes):
        numbers = positions(result.axes[parameter])
        order = np.argsort(numbers, kind="stable")
        values = np.take(values, order, axis=dimension)
        coordinates.append(numbers[order])
    up, across = coordinates
    mesh = panel.pcolormesh(across, up, values, shading="nearest", rasterized=True, **colours)
    for axis, parameter in zip((panel.yaxis, panel.xaxis), result.axes, strict=True):
        label_parameter(axis, result, parameter)
    panel.tick_params(color=style.GREY, labelsize=9)
    panel.spines[:].set_color(style.GREY)
    return mesh


def require_one_axes_each(axes: Sequence[Axes], names: Sequence[str]) -> None:
    """Raise an error if the number of axes differs from the number of results."""
    if len(axes) != len(names):
        raise UsageError(
            f"{len(axes)} axes were passed for {len(names)} results", remedy="use one axes per result"
        )


def setting(result: Sweep, name: str, value: object) -> str:
    """Return a parameter with one value as text, such as "N = 40 N"."""
    number = f"{value:.6g}" if isinstance(value, float) else literal(str(value))
    return f"{symbol_of(name)} = {number} {unit_text(result.units.get(name, ''))}".rstrip()


def title_of(result: Sweep) -> str:
    """Return the title of a picture of a sweep."""
    return result.model.title or result.model.name
