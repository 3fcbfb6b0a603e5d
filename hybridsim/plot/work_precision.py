"""Error against cost, one panel for each kind of error: what accuracy costs with each integrator."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import EngFormatter, FixedLocator, LogLocator, NullFormatter

from hybridsim.analysis.rows import QUANTITIES, Row
from hybridsim.errors import UsageError
from hybridsim.plot import style

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

    from hybridsim.analysis import Comparison

_SIZE = 6.5
_MOST_TICKS = 5  # across a panel
_NOTHING = {
    "state": "no run to show",
    "state_last_period": "the model has no period",
    "event_time": "no events to compare",
}
_ZERO = 1e-17  # where an error of exactly zero is drawn: below any rounding


def work_precision(comparison: Comparison, axes: Sequence[Axes] | None = None) -> tuple[Axes, Axes, Axes]:
    """Draw three panels: state error over the whole run, over the last period, and of the event times.

    The wall time runs across, the error up; a line joins the settings of one integrator. A run with a wrong
    sequence of modes is hollow: its errors compare what is not the same motion. Stick erases memory, so an
    error at the end alone may be small after a run that was wrong; that is why there are three panels.

    Parameters
    ----------
    axes : three axes to draw in; a new figure if not given.
    """
    if axes is None:
        figure = style.figure(13.0, 5.4)
        figure.suptitle(_headline(comparison), fontsize=10, x=0.01, ha="left")
        panels = tuple(figure.subplots(1, 3))
    else:
        panels = tuple(axes)
    if len(panels) != 3:
        raise UsageError(f"{len(panels)} axes for three panels", remedy="give three axes")
    per = " / T" if comparison.period else ""
    titles = (
        "State error, whole run / amplitude",
        "State error, last period / amplitude",
        f"Largest event-time error{per}",
    )
    for panel, quantity, title in zip(panels, QUANTITIES, titles):
        _panel(panel, comparison, quantity)
        panel.set_title(title, fontsize=10, loc="left")
    _legend(comparison, panels[-1])
    return panels


def _headline(comparison: Comparison) -> str:
    t0, t1 = comparison.t_span
    long = f"{(t1 - t0) / comparison.period:.4g} periods" if comparison.period else f"t = {t0:g} to {t1:g}"
    return style.literal(f"{comparison.title}, {long}\nReference: {comparison.reference}")


def _panel(panel: Axes, comparison: Comparison, quantity: str) -> None:
    for i, label in enumerate(comparison.labels):
        colour, marker = _look(i)
        rows = [row for row in comparison.rows if row.label == label]
        points = [point for row in rows if (point := _point(comparison, row, quantity))]
        if not points:
            continue
        x, y = zip(*(point for point, _ in points))
        panel.plot(x, y, color=colour, linewidth=1.1, zorder=2)
        for row in rows:
            point = _point(comparison, row, quantity)
            if point is None or row.cost is None:
                continue
            (time, error), right = point
            times = row.cost.wall_times
            panel.plot(
                [min(times), max(times)], [error, error], color=colour, linewidth=2.5, alpha=0.35, zorder=2
            )
            fill = colour if right else "white"
            panel.plot(
                time, error, marker, color=colour, markerfacecolor=fill, markersize=_SIZE, markeredgewidth=1.3
            )
    style.dress(panel)
    if not panel.lines:
        panel.text(0.5, 0.5, _NOTHING[quantity], transform=panel.transAxes, ha="center", color=style.FAINT)
        panel.set_xticks([])
        panel.set_yticks([])
        return
    panel.set_xscale("log")
    panel.set_yscale("log")
    floor = comparison.floor(quantity)
    if floor > 0:
        low, high = panel.get_ylim()
        panel.set_ylim(min(low, floor / 3), high)
        panel.axhspan(min(low, floor / 3), floor, color="#eeeeee", zorder=0)
    _ticks(panel)
    panel.set_xlabel("wall time", fontsize=9)


def _point(comparison: Comparison, row: Row, quantity: str) -> tuple[tuple[float, float], bool] | None:
    """(Wall time, error) and whether the modes are right; None for what cannot be drawn."""
    reading = comparison.reading(row, quantity)
    if reading is None or row.cost is None or row.errors is None or not math.isfinite(reading.value):
        return None
    return (row.cost.wall_time, max(reading.value, _ZERO)), row.errors.sequence.right


def _look(i: int) -> tuple[str, str]:
    colours = (*style.PALETTE, style.INK)
    return colours[i % len(colours)], style.MARKERS[i % len(style.MARKERS)]


def _ticks(panel: Axes) -> None:
    """Wall times as "20 ms", as many as can be read; decades of the error."""
    low, high = panel.get_xlim()
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for steps in ((1, 2, 3, 4, 6, 8), (1, 2, 5), (1, 3), (1,)):
        times = [step * 10.0**decade for decade in decades for step in steps]
        times = [time for time in times if low <= time <= high]
        if len(times) <= _MOST_TICKS:
            break
    panel.xaxis.set_major_locator(FixedLocator(times[:: math.ceil(len(times) / _MOST_TICKS) or 1]))
    panel.xaxis.set_major_formatter(EngFormatter(unit="s", sep="\N{THIN SPACE}"))
    panel.xaxis.set_minor_formatter(NullFormatter())
    panel.yaxis.set_major_locator(LogLocator(numticks=9))
    panel.yaxis.set_minor_formatter(NullFormatter())


def _legend(comparison: Comparison, panel: Axes) -> None:
    handles: list[Artist] = []
    for i, label in enumerate(comparison.labels):
        colour, marker = _look(i)
        failed = sum(row.label == label and row.errors is None for row in comparison.rows)
        text = style.literal(label) + (f" ({failed} failed)" if failed else "")
        handles.append(
            Line2D([], [], color=colour, marker=marker, markersize=_SIZE, linewidth=1.1, label=text)
        )
    if any(row.errors is not None and not row.errors.sequence.right for row in comparison.rows):
        handles.append(
            Line2D(
                [],
                [],
                color=style.INK,
                marker="o",
                markerfacecolor="white",
                markersize=_SIZE,
                linewidth=0,
                label="hollow: wrong modes",
            )
        )
    if any(comparison.floor(quantity) > 0 for quantity in QUANTITIES):
        handles.append(Patch(color="#eeeeee", label="reference uncertain"))
    panel.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.02, 1.0), frameon=False, fontsize=9)
