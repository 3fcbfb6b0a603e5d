"""This module draws a comparison of friction laws: the friction loops, with the amplitudes beside the loops."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from hybridsim.arguments import text
from hybridsim.plot.shared import style
from hybridsim.plot.shared.scale import label_axis, with_prefix
from hybridsim.plot.shared.smooth_parts import smooth_parts_of, title_of, unit_of, window_of

if TYPE_CHECKING:
    from hybridsim.analysis import LawComparison
    from hybridsim.analysis.laws.law_comparison import LawRow


def law_comparison(comparison: LawComparison, x: str | None = None) -> tuple[Axes, Axes]:
    """Draw the contact force over a quantity of the model for each law, and a measure of each run as bars.

    The bars show the first reading of the comparison, or the amplitude. A complex reading is drawn as its magnitude.
    The area of a loop is the energy loss if `x` is the relative displacement.

    Parameters
    ----------
    x : the quantity along the axis of the loops, such as "v" or "v_rel(f)"; by default that of the comparison.
    """
    across = comparison.quantity if x is None else text(x, "x")
    up, rows = comparison.contact, comparison.rows
    figure = style.figure(9.0, max(3.6, 1.6 + 0.4 * len(rows)))
    style.put_title(figure, style.literal(comparison.title), size=10)
    loops, bars = figure.subplots(1, 2, width_ratios=(3, 2))
    units = [unit_of(rows[0].solution, name) for name in (across, up)]
    ends = {across: [0.0], up: [0.0]}
    sizes: list[float | None] = []
    name, unit = f"amplitude of {comparison.quantity}", unit_of(rows[0].solution, comparison.quantity)
    if comparison.readings:
        name = comparison.readings[0]
        unit = comparison.units.get(name, "")
    for k, row in enumerate(rows):
        colour = style.PALETTE[k % len(style.PALETTE)]
        if row.solution.t_end > row.solution.t_start:
            parts = smooth_parts_of(row.solution, (across, up), window_of(row.solution, comparison.t_span))
            points = [np.concatenate([part.values[name] for part in parts]) for name in (across, up)]
            width = 1.4 if k else 2.8  # the first line is seen below the others
            loops.plot(*points, color=colour, linewidth=width, linestyle=("-", "--", "-.", ":")[k % 4])
            for axis, values in zip((across, up), points, strict=True):
                ends[axis] += [values.min(), values.max()]
        sizes.append(_size(row, comparison))
        bars.barh(k, sizes[k] or 0.0, color=colour, height=0.6)
        bars.annotate(f" {_text(sizes[k], unit)}", (max(sizes[k] or 0.0, 0.0), k), va="center", fontsize=9)
    for axis, name_of_axis, unit_of_axis in zip((loops.xaxis, loops.yaxis), (across, up), units, strict=True):
        least, most = min(ends[name_of_axis]), max(ends[name_of_axis])
        title = title_of(rows[0].model, name_of_axis)
        label_axis(axis, name_of_axis, unit_of_axis, least, most, title=title)
    drawn = [0.0, *(size for size in sizes if size is not None)]
    label_axis(bars.xaxis, name, unit, min(drawn), max(drawn))
    bars.set_yticks(range(len(rows)), [style.literal(row.label) for row in rows])
    bars.invert_yaxis()
    bars.margins(x=0.25)
    for axes in (loops, bars):
        style.dress(axes)
    return loops, bars


def _size(row: LawRow, comparison: LawComparison) -> float | None:
    """Return the finite number that the bar of a law shows, or None."""
    if not comparison.readings:
        return row.amplitude_of_quantity
    value = row.measured[comparison.readings[0]]
    if value is None or isinstance(value, str):
        return None
    size = float(abs(value) if isinstance(value, complex) else value)
    return size if math.isfinite(size) else None


def _text(size: float | None, unit: str) -> str:
    if size is None:
        return "no result"
    rounded = float(f"{size:.3g}")
    sign = "-" if rounded < 0.0 else ""
    return sign + with_prefix(abs(rounded), unit) if rounded else "0"
