"""This module draws error against cost, with one panel per kind of error."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import EngFormatter, FixedLocator, LogLocator, NullFormatter

from hybridsim.errors import UsageError
from hybridsim.plot.shared import style
from hybridsim.plot.shared.lines import PALE, SIZE, Look, draw_line, looks

if TYPE_CHECKING:
    from hybridsim.analysis import Comparison
    from hybridsim.analysis.compare.rows import Row

_MOST_TICKS = 4  # across a panel
_APART = 0.25  # of a panel: the least distance of two ticks
_COLUMNS = 2
_HEIGHT, _AROUND = 3.0, 1.6  # inches of a row of panels, and of title and legend
_TITLES = {
    "state": "state error, whole run / amplitude",
    "state_last_period": "state error, last period / amplitude",
    "event_time": "largest event-time error",
    "graph": "distance of the graphs",
}
_ZERO = 1e-17  # position of an error of exactly zero, below rounding
_UNCERTAIN = "#eeeeee"


def work_precision(comparison: Comparison, axes: Sequence[Axes] | None = None) -> tuple[Axes, ...]:
    """Draw error against cost, one panel for each kind of error (`Comparison.quantities`).

    The wall time is horizontal and the error vertical; a line joins the settings of one integrator. A run
    with a wrong sequence of modes is hollow and at the top edge, because its errors compare different motions.
    Stick erases the memory of errors, so that a run may have a small error at its end; several panels are
    needed to see this.

    Parameters
    ----------
    axes : as many axes as kinds of error, to draw in; by default a new figure.
    """
    quantities = comparison.quantities
    if axes is None:
        rows = math.ceil(len(quantities) / _COLUMNS)
        figure = style.figure(style.WIDTH, _HEIGHT * rows + _AROUND)
        style.put_title(figure, headline(comparison), size=10)
        every = figure.subplots(rows, min(_COLUMNS, len(quantities)), squeeze=False).ravel()
        panels = tuple(every[: len(quantities)])
        for empty in every[len(quantities) :]:
            empty.set_axis_off()
    else:
        panels = tuple(axes)
    if len(panels) != len(quantities):
        raise UsageError(
            f"{len(panels)} axes were passed for {len(quantities)} kinds of error",
            remedy=f"use {len(quantities)} axes",
        )
    chosen = looks(comparison.rows)
    for panel, quantity in zip(panels, quantities, strict=True):
        draw_panel(panel, comparison, quantity, chosen)
        per = " / T" if comparison.period and quantity == "event_time" else ""
        panel.set_ylabel(_TITLES[quantity] + per, fontsize=9)
        panel.set_xlabel("wall time", fontsize=9)
    named = handles(comparison.rows, [comparison], chosen)
    if axes is None:
        style.legend_below(style.figure_of(panels), named)
    else:
        panels[-1].legend(
            handles=named,
            loc="upper left",
            bbox_to_anchor=(1.02, 1.0),
            frameon=False,
            fontsize=9,
            handlelength=3,
        )
    return panels


def headline(comparison: Comparison) -> str:
    """Return the title of a comparison, which names the model, the result, the length of the run and the reference."""
    from hybridsim.analysis.compare.table import cheapest

    t0, t1 = comparison.t_span
    long = f"{(t1 - t0) / comparison.period:.4g} periods" if comparison.period else f"t = {t0:g} to {t1:g}"
    parts = [f"{comparison.title}: {cheapest(comparison.rows)}", f"{long}; reference: {comparison.reference}"]
    lost = [label for label in comparison.labels if not _has_result(comparison.rows, label)]
    if lost:
        parts.append(f"no result: {', '.join(lost)}")
    return style.wrapped(*parts)


def _has_result(rows: Iterable[Row], label: str) -> bool:
    return any(row.label == label and row.errors is not None for row in rows)


def draw_panel(
    panel: Axes, comparison: Comparison, quantity: str, chosen: dict[str, Look], size: float = SIZE
) -> None:
    """Draw one kind of error against the wall time, for all lines."""
    for label in comparison.labels:
        rows = [row for row in comparison.rows if row.label == label]
        found = [(row, point) for row in rows if (point := _point(comparison, row, quantity))]
        draw_line(
            panel,
            chosen[label],
            [point for _, point in found],
            [(min(row.cost.wall_times), max(row.cost.wall_times)) for row, _ in found if row.cost],
            [verdict_of(row) for row, _ in found],
            size,
            [is_cold(row) for row, _ in found],
        )
    style.dress(panel)
    if not panel.lines:
        panel.text(0.5, 0.5, "no run to show", transform=panel.transAxes, ha="center", color=style.TEXT_GREY)
        panel.set_xticks([])
        panel.set_yticks([])
        return
    panel.set_xscale("log")
    panel.set_yscale("log")
    floor = comparison.floor(quantity)
    if not any(line.get_transform() == panel.transData for line in panel.lines):  # all modes are wrong
        panel.set_ylim(floor or _ZERO, 1.0)
    if floor > 0:
        low, high = panel.get_ylim()
        panel.set_ylim(min(low, floor / 3), high)
        panel.axhspan(min(low, floor / 3), floor, color=_UNCERTAIN, zorder=0)
    label_ticks(panel)


def _point(comparison: Comparison, row: Row, quantity: str) -> tuple[float, float] | None:
    """Return (wall time, error), or None if the point cannot be drawn."""
    reading = comparison.reading(row, quantity)
    if reading is None or row.cost is None or not math.isfinite(reading.value):
        return None
    return row.cost.wall_time, max(reading.value, _ZERO)


def is_cold(row: Row) -> bool:
    """Return whether a run was timed only once, during its warm-up."""
    return row.cost is not None and row.cost.repetitions == 0


def verdict_of(row: Row) -> bool | None:
    """Return whether the mode sequence of a run is right, or None if the run has no modes."""
    return row.errors.sequence.right if row.errors and row.errors.sequence is not None else None


def label_ticks(panel: Axes) -> None:
    """Set a readable number of tick labels for wall times, and ticks at powers of ten for the error."""
    low, high = panel.get_xlim()
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for steps in ((1, 2, 3, 4, 6, 8), (1, 2, 5), (1, 3), (1,)):
        times = [step * 10.0**decade for decade in decades for step in steps]
        times = [time for time in times if low <= time <= high]
        ratios = [later / earlier for earlier, later in itertools.pairwise(times)]
        if len(times) <= _MOST_TICKS and min(ratios, default=high / low) >= (high / low) ** _APART:
            break
    else:  # powers of ten, of which only every second or third has room
        every = math.ceil(math.log10(high / low) * _APART)
        times = [time for time in times if round(math.log10(time)) % every == 0]
    panel.xaxis.set_major_locator(FixedLocator(times))
    panel.xaxis.set_major_formatter(EngFormatter(unit="s", sep="\N{THIN SPACE}"))
    panel.xaxis.set_minor_formatter(NullFormatter())
    panel.yaxis.set_major_locator(LogLocator(numticks=9))
    panel.yaxis.set_minor_formatter(NullFormatter())


def handles(
    rows: Iterable[Row], comparisons: Sequence[Comparison], chosen: dict[str, Look], size: float = SIZE
) -> list[Artist]:
    """Return the legend entries of the lines, and of the hollow, half filled and grey marks that occur."""
    from hybridsim.analysis.compare.rows import QUANTITIES

    rows = list(rows)
    found: list[Artist] = []
    for label, look in chosen.items():
        if not _has_result(rows, label):
            continue
        lost = sum(row.label == label and row.errors is None for row in rows)
        found.append(look.handle(style.literal(label) + (f" ({lost} without result)" if lost else ""), size))
    verdicts = {verdict_of(row) for row in rows if row.errors is not None}
    for verdict, fill, text in (
        (False, "none", "hollow, at the top: wrong modes"),
        (None, "left", "half filled: no modes to judge"),
    ):
        if verdict in verdicts:
            mark = Line2D([], [], color=style.INK, marker="o", markersize=size, linewidth=0, label=text)
            mark.set(fillstyle=fill, markerfacecoloralt="white")
            found.append(mark)
    if any(is_cold(row) for row in rows):
        mark = Line2D([], [], color=style.INK, marker="o", markersize=size, linewidth=0, alpha=PALE)
        mark.set_label("pale: timed once, not warmed up")
        found.append(mark)
    if any(comparison.floor(quantity) > 0 for comparison in comparisons for quantity in QUANTITIES):
        found.append(Patch(color=_UNCERTAIN, label="reference uncertain"))
    return found
