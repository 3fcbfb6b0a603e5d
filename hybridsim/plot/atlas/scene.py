"""This module draws the small picture of a test case: the true motion with its events, and a typical failure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import MaxNLocator

from hybridsim.plot.shared import style
from hybridsim.plot.shared.scale import label_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from hybridsim.testing.atlas.example import Example, Line

_RIGHT, _WRONG = style.INK, style.PALETTE[1]
_MAX_TICKS = 400  # ticks of events; more are drawn as a band
_MAX_LABELS = 6  # of the axis of time: more long numbers would overlap
_SMALL = 0.04  # of the motion: a smaller error gets its own scale
_BEYOND = 1.5  # a diverging run is cut at this multiple of the true motion's height


def scene(example: Example) -> Axes:
    """Draw one state in a time window, and below it the events of the correct and of the failing run, if any."""
    right, failing = example.right, example.failing
    off = None if failing is None else _error(right, failing)
    has_events = any(line is not None and line.events.size for line in (right, failing))
    heights = [6, *([4] if off is not None else []), *([1] if has_events else [])]
    figure = style.figure(5.2, 0.8 + 0.24 * sum(heights))
    panels = list(np.ravel(figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)))
    axes = panels[0]
    style.dress(axes)
    if off is not None:
        style.dress(panels[1])
        panels[1].plot(right.t, off, color=_WRONG, linewidth=1.2)
        extremes = float(np.nanmin(off)), float(np.nanmax(off))
        label_axis(panels[1].yaxis, example.state, example.unit, *extremes, title="error of")
    axes.plot(right.t, right.x, color=_RIGHT, linewidth=1.2, label="true motion")
    if failing is not None:
        label = failing.name + (" (ends early)" if example.stopped else "")
        axes.plot(
            failing.t, failing.x, color=_WRONG, linewidth=1.4, dashes=(4, 1.5), label=style.literal(label)
        )
        if example.stopped and failing.t.size:
            axes.plot(failing.t[-1], failing.x[-1], "X", color=_WRONG, markersize=7)
    if example.points:
        t, x = np.array(example.points).T
        axes.plot(
            t, x, "o", color=_RIGHT, markerfacecolor="white", markersize=4, linestyle="", label="known values"
        )
    low, high = right.x.min(), right.x.max()
    if failing is not None and failing.x.size:
        height = (high - low) or abs(high) or 1.0
        low, high = (
            max(min(low, np.nanmin(failing.x)), low - _BEYOND * height),
            min(max(high, np.nanmax(failing.x)), high + _BEYOND * height),
        )
    margin = 0.08 * (high - low) or 0.1 * abs(high) or 0.1
    axes.set_ylim(low - margin, high + margin)
    label_axis(axes.yaxis, example.state, example.unit, low, high)
    axes.legend(
        loc="lower right", bbox_to_anchor=(1, 1), ncols=3, frameon=False, fontsize=8, borderaxespad=0.2
    )
    if has_events:
        _strip(panels[-1], right, failing)
    panels[-1].xaxis.set_major_locator(MaxNLocator(_MAX_LABELS, steps=(1, 2, 2.5, 5, 10)))
    label_axis(panels[-1].xaxis, "t", example.time, float(right.t[0]), float(right.t[-1]))
    return axes


def _strip(axes: Axes, right: Line, failing: Line | None) -> None:
    """Draw the events of the correct run above those of the failing run, and write their numbers at the right edge."""
    for line, bottom, colour in ((right, 0.55, _RIGHT), (failing, 0.05, _WRONG)):
        if line is None:
            continue
        times = line.events[:: -(-line.events.size // _MAX_TICKS) or 1]
        axes.vlines(times, bottom, bottom + 0.4, color=colour, linewidth=1.1)
        number = f"{line.events.size} event{'s' * (line.events.size != 1)}"
        where = axes.get_yaxis_transform()
        axes.text(1.01, bottom + 0.2, number, color=colour, fontsize=8, va="center", transform=where)
    axes.set_ylim(0, 1)
    axes.set_yticks([])
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(labelsize=9)


def _error(right: Line, failing: Line) -> np.ndarray | None:
    """Return the difference of two runs if this difference exceeds rounding but is too small to see, else None."""
    if failing.t.size < 2:
        return None
    off = np.interp(right.t, failing.t, failing.x, left=np.nan, right=np.nan) - right.x
    size = np.nanmax(np.abs(off), initial=0.0)
    return off if 1e-9 * np.ptp(right.x) < size < _SMALL * np.ptp(right.x) else None
