"""This module draws displacement, friction force and harmonics, with a column per method."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from hybridsim.plot.shared import style
from hybridsim.studies.he2026.measured.response import Response

_MICRO = 1e6
_LEAST = 1e-6  # relative to the first; smaller harmonics are rounding and are drawn at this value
# short column titles for the readings of the method
_TITLES = {"sign by step": "without stick, sign by step", "sign by stage": "without stick, sign by stage"}


def column_title(name: str) -> str:
    """Return a short title for a method."""
    if name.startswith("v "):
        return f"with stick, {name.split(',')[0]}"
    return _TITLES.get(name, name)


def plain_log(axis: Axis) -> None:
    """Set a logarithmic axis with ticks at 1, 2, 5, 10, 20, ..., in plain numbers."""
    axis.axes.set_xscale("log")
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter("{x:g}")


def motions(runs: dict[str, Response], title: str, spectrum: bool = False) -> Figure:
    """Draw x and f over two periods; with `spectrum`, also draw the harmonics of x."""
    names = [*(name for name in runs if name != "exact"), "exact"]
    rows = 3 if spectrum else 2
    figure = style.figure(min(2.45 * len(names) + 0.6, style.BROAD), 1.9 * rows + 0.6)
    style.put_title(figure, title)
    panels = figure.subplots(rows, len(names), sharey="row", squeeze=False)
    for column, name in enumerate(names):
        run, colour = runs[name], style.INK if name == "exact" else style.PALETTE[column]
        x, f = panels[0, column], panels[1, column]
        x.plot(run.t, _MICRO * run.x, color=colour, linewidth=1.1)
        f.plot(run.t, run.f, color=colour, linewidth=0.8)
        x.set_title(column_title(name).replace(", ", ",\n"), fontsize=9, loc="left")
        f.set_xlabel("time / period", fontsize=9)
        for axes in (x, f):
            style.dress(axes)
            axes.set_xlim(0.0, 2.0)
            axes.set_xticks([0.0, 1.0, 2.0], labels=["0", "1", "2"])
        if spectrum:
            _harmonics(panels[2, column], run, colour)
    for axes, label in zip(
        panels[:, 0], ("x [µm]", "friction force [N]", "harmonic of x / first"), strict=False
    ):
        axes.set_ylabel(label, fontsize=9)
    return figure


def _harmonics(axes: Axes, run: Response, colour: str) -> None:
    orders = np.arange(len(run.harmonics))
    heights = np.maximum(run.harmonics, _LEAST)
    axes.vlines(orders, _LEAST, heights, color=colour, linewidth=1.6)
    axes.plot(orders, heights, "o", color=colour, markersize=3)
    axes.set_yscale("log")
    axes.set_ylim(_LEAST, 3.0)
    axes.set_xlim(-0.7, orders[-1] + 0.7)
    axes.set_xticks(orders[1::4])
    style.dress(axes)
    axes.set_xlabel("harmonic of w", fontsize=9)
