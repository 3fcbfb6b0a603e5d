"""This module draws results of a sweep as lines over one parameter, one line for each value of the other parameter."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.axes import Axes

from hybridsim.arguments import known_name
from hybridsim.errors import UsageError
from hybridsim.plot.shared import style
from hybridsim.plot.sweeps.readings import (
    NO_RESULT,
    chosen_names,
    label_parameter,
    label_result,
    numbers_of,
    positions,
    require_one_axes_each,
    setting,
    show_range,
    title_of,
)

if TYPE_CHECKING:
    from hybridsim.analysis import Sweep

_MARKED_POINTS = 30  # points of a line up to which each is marked
_DOT = 5.0  # size of the items of an array, for the first line
_FINAL = (
    "final."  # states at the end of runs jump from point to point, for instance in chaos: no line joins them
)
_CROWD = 12  # lines up to which the legend names each; of more lines it names some
_WIDTH, _HEIGHT, _MORE = 7.2, 2.0, 1.1  # inches of a panel, and of the space above and below


def sweep_lines(
    result: Sweep, *names: str, over: str | None = None, axes: tuple[Axes, ...] | None = None
) -> tuple[Axes, ...]:
    """Draw results of a sweep over one parameter, with a panel for each result; arrays are drawn as dots.

    Parameters
    ----------
    names : readings; by default up to six numerical ones, with amplitudes, stick and stops first.
    over : the parameter on the horizontal axis; by default the longest numerical one.
    axes : as many axes as readings, to draw in; by default a new figure.
    """
    dimensions = list(result.axes) if result.mode == "grid" else [next(iter(result.axes))]
    if len(dimensions) > 2:
        raise UsageError(
            f"the sweep has {len(dimensions)} parameters, but lines show at most two",
            remedy="select a part with at most two parameters by to_xarray().sel(...)",
        )
    lengths = dict(zip(dimensions, result.status.shape, strict=True))
    across = over
    if over is None:  # texts have no distances
        across = max(dimensions, key=lambda name: (result.axes[name].dtype.kind == "f", lengths[name]))
    across = known_name(across, dimensions, "`over` cannot be", "parameters")
    found = chosen_names(result, names, arrays=True)
    if axes is None:
        figure = style.figure(_WIDTH, _HEIGHT * len(found) + _MORE)
        axes = tuple(figure.subplots(len(found), 1, sharex=True, squeeze=False)[:, 0])
        style.head(axes[0], title_of(result))
    require_one_axes_each(axes, found)
    others = [name for name in dimensions if name != across]
    for panel, name in zip(axes, found, strict=True):
        _draw(panel, result, name, across, others[0] if others else None, dimensions)
    label_parameter(axes[-1].xaxis, result, across)
    if others:
        _legend(axes[0], lengths[others[0]])
    return axes


def _draw(
    panel: Axes, result: Sweep, name: str, across: str, other: str | None, dimensions: list[str]
) -> None:
    values = numbers_of(result, name)
    if dimensions[0] != across:
        values = values.swapaxes(0, 1)
    x = positions(result.axes[across])
    order = np.argsort(x, kind="stable")
    lines = [""] if other is None else [setting(result, other, value) for value in result.axes[other]]
    colours = _colours(len(lines))
    has_items = values.ndim > len(dimensions)
    for k, (label, colour) in enumerate(zip(lines, colours, strict=True)):
        y = values if other is None else values[:, k]
        if has_items:
            dots = np.broadcast_to(x[:, None], y.shape)
            size = _DOT * 0.6**k  # dots under other dots remain visible around them
            panel.plot(dots.ravel(), y.ravel(), ".", color=colour, markersize=max(size, 1.5), label=label)
        else:
            is_joined = not name.startswith(_FINAL)
            marker = "o" if len(x) <= _MARKED_POINTS or not is_joined else ""
            panel.plot(
                x[order],
                y[order],
                color=colour,
                marker=marker,
                markersize=3,
                linewidth=1.3 * is_joined,
                label=label,
            )
    style.dress(panel)
    there = np.isfinite(values).any(axis=-1) if has_items else np.isfinite(values)
    lost = x[~there.reshape(len(x), -1).all(axis=1)]
    if lost.size:
        panel.plot(
            lost, np.full(lost.size, 0.02), "x", color=style.PALETTE[1], markersize=4, label=NO_RESULT,
            transform=panel.get_xaxis_transform(), clip_on=False,
        )  # fmt: skip
        if other is None:
            panel.legend(handles=panel.lines[-1:], fontsize=8, frameon=False)
    label_result(panel.yaxis, result, name, values)
    show_range(panel.yaxis, values)


def _colours(count: int) -> list[str]:
    """Return distinct colours for few lines, and colours from dark to light for many."""
    if count <= len(style.PALETTE):
        return list(style.PALETTE[:count])
    shades = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, count))
    return [matplotlib.colors.to_hex(shade) for shade in shades]


def _legend(panel: Axes, count: int) -> None:
    handles, labels = panel.get_legend_handles_labels()
    if count > _CROWD:
        shown = sorted({*range(0, count, -(-count // _CROWD)), *range(count - 1, len(handles))})
        handles, labels = [handles[k] for k in shown], [labels[k] for k in shown]
    panel.legend(
        handles,
        labels,
        loc="upper left",
        bbox_to_anchor=(1.01, 1.0),
        fontsize=8,
        frameon=False,
        labelspacing=0.3,
    )
