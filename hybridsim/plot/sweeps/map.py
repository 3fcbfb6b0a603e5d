"""This module draws results of a sweep over two parameters as maps."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from hybridsim.errors import UsageError
from hybridsim.plot.shared import style
from hybridsim.plot.sweeps.readings import (
    NO_COLOUR,
    NO_RESULT,
    chosen_names,
    draw_map,
    label_result,
    numbers_of,
    require_one_axes_each,
    title_of,
)

if TYPE_CHECKING:
    from hybridsim.analysis import Sweep

_COLUMNS = 3
_WIDTH, _HEIGHT, _MORE = 4.6, 3.4, 0.5  # inches of a map with its colour bar, and of the title
_BETWEEN = 0.12  # inches on each side, so that the label of a colour bar is not read as that of the next map


def sweep_map(result: Sweep, *names: str, axes: tuple[Axes, ...] | None = None) -> tuple[Axes, ...]:
    """Draw results of a sweep over two parameters as maps: the first parameter is vertical, the second is horizontal.

    Points without a result are grey.

    Parameters
    ----------
    names : readings; by default up to six numerical ones, with amplitudes, stick and stops first.
    axes : as many axes as readings, to draw in; by default a new figure.
    """
    if len(result.axes) != 2 or result.mode != "grid":
        raise UsageError(
            f"a map needs a grid of two parameters, but this sweep is a {result.mode} of {len(result.axes)} "
            "parameters",
            remedy="draw lines, or select a part of the sweep with to_xarray().sel(...)",
        )
    found = chosen_names(result, names, arrays=False)
    if axes is None:
        columns = min(_COLUMNS, math.ceil(math.sqrt(len(found))))
        rows = math.ceil(len(found) / columns)
        figure = style.figure(_WIDTH * columns, _HEIGHT * rows + _MORE)
        figure.set_layout_engine("constrained", w_pad=_BETWEEN)
        style.put_title(figure, style.literal(title_of(result)), size=10)
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        for empty in panels[len(found) :]:
            empty.remove()
        axes = tuple(panels[: len(found)])
    require_one_axes_each(axes, found)
    for panel, name in zip(axes, found, strict=True):
        _draw(panel, result, name)
    return axes


def _draw(panel: Axes, result: Sweep, name: str) -> None:
    values = numbers_of(result, name)
    shades = matplotlib.colormaps["viridis"].with_extremes(bad=NO_COLOUR)
    mesh = draw_map(panel, result, np.ma.masked_invalid(values), cmap=shades)
    bar = panel.figure.colorbar(mesh, ax=panel, pad=0.02)
    bar.outline.set_visible(False)
    bar.ax.tick_params(color=style.GREY, labelsize=9)
    label_result(bar.ax.yaxis, result, name, values)
    if not np.isfinite(values).all():
        panel.legend(handles=[Patch(color=NO_COLOUR, label=NO_RESULT)], fontsize=8, loc="upper right")
