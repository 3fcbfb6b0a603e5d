"""This module draws the small picture of a test case: the true motion with its events, and a typical failure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hybridsim.plot.shared import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from hybridsim.testing.atlas.example import Example, Line

_RIGHT, _WRONG = style.INK, style.PALETTE[1]
_MAX_TICKS = 400  # ticks of events; more are drawn as a band
_SMALL = 0.04  # of the motion: a smaller error gets its own scale
_BEYOND = 1.5  # a diverging run is cut at this multiple of the true motion's height


def scene(example: Example) -> Axes:
    """Draw one state in a time window, and below it the events of the correct and of the failing run."""
    right, failing = example.right, example.failing
    off = None if failing is None else _error(right, failing)
    figure = style.figure(5.2, 2.5 if off is None else 3.3)
    axes, *middle, strip = figure.subplots(
        2 if off is None else 3, 1, sharex=True, height_ratios=(6, 1) if off is None else (6, 4, 1)
    )
    style.dress(axes)
    if off is not None:
        style.dress(middle[0])
        middle[0].plot(right.t, off, color=_WRONG, linewidth=1.2)
        middle[0].set_ylabel(f"error of {example.state}")
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
    axes.set_ylabel(style.literal(f"{example.state} [{example.unit}]" if example.unit else example.state))
    axes.legend(
        loc="lower right", bbox_to_anchor=(1, 1), ncols=3, frameon=False, fontsize=8, borderaxespad=0.2
    )
    for line, bottom, colour in ((right, 0.55, _RIGHT), (failing, 0.05, _WRONG)):
        if line is not None and line.events.size:
            times = line.events[:: -(-line.events.size // _MAX_TICKS)]
            strip.vlines(times, bottom, bottom + 0.4, color=colour, linewidth=1.1)
        if line is not None:
            where = strip.get_yaxis_transform()
            strip.text(
                1.01,
                bottom + 0.2,
                str(line.events.size),
                color=colour,
                fontsize=7,
                va="center",
                transform=where,
            )
    strip.set_ylim(0, 1)
    strip.set_yticks([])
    strip.set_ylabel("events", rotation=0, ha="right", va="center", fontsize=8)
    strip.spines[["top", "right", "left"]].set_visible(False)
    strip.tick_params(labelsize=8)
    strip.set_xlabel(f"t [{example.time}]" if example.time else "t")
    return axes


def _error(right: Line, failing: Line) -> np.ndarray | None:
    """Return the difference of two runs if this difference exceeds rounding but is too small to see, else None."""
    if failing.t.size < 2:
        return None
    off = np.interp(right.t, failing.t, failing.x, left=np.nan, right=np.nan) - right.x
    size = np.nanmax(np.abs(off), initial=0.0)
    return off if 1e-9 * np.ptp(right.x) < size < _SMALL * np.ptp(right.x) else None
