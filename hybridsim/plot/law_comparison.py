"""This module draws a comparison of friction laws: the friction loops, with the amplitudes beside the loops."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from hybridsim.plot.shared import style
from hybridsim.plot.shared.scale import label_axis, with_prefix
from hybridsim.plot.shared.smooth_parts import smooth_parts_of, unit_of, window_of

if TYPE_CHECKING:
    from hybridsim.analysis import LawComparison


def law_comparison(comparison: LawComparison) -> tuple[Axes, Axes]:
    """Draw the force of the contact over the quantity for each law, and the amplitudes as bars in the same colours.

    The area of a loop is the energy loss per period if the quantity is the relative displacement.
    """
    across, up, rows = comparison.quantity, comparison.contact, comparison.rows
    figure = style.figure(9.0, max(3.6, 1.6 + 0.4 * len(rows)))
    style.put_title(figure, style.literal(comparison.title), size=10)
    loops, bars = figure.subplots(1, 2, width_ratios=(3, 2))
    units = [unit_of(rows[0].solution, name) for name in (across, up)]
    ends = {across: [0.0], up: [0.0]}
    for k, row in enumerate(rows):
        colour = style.PALETTE[k % len(style.PALETTE)]
        if row.solution.t_end > row.solution.t_start:
            parts = smooth_parts_of(row.solution, (across, up), window_of(row.solution, None))
            x, y = (np.concatenate([part.values[name] for part in parts]) for name in (across, up))
            loops.plot(x, y, color=colour, linewidth=1.4, linestyle=("-", "--", "-.", ":")[k % 4])
            for name, values in ((across, x), (up, y)):
                ends[name] += [values.min(), values.max()]
        size = row.amplitude_of_quantity
        bars.barh(k, size or 0.0, color=colour, height=0.6)
        text = "no result" if size is None else with_prefix(float(f"{size:.3g}"), units[0]) if size else "0"
        bars.annotate(f" {text}", (size or 0.0, k), va="center", fontsize=9)
    label_axis(loops.xaxis, across, units[0], min(ends[across]), max(ends[across]))
    label_axis(loops.yaxis, up, units[1], min(ends[up]), max(ends[up]))
    sizes = [row.amplitude_of_quantity or 0.0 for row in rows]
    label_axis(bars.xaxis, f"amplitude of {across}", units[0], 0.0, max(sizes))
    bars.set_yticks(range(len(rows)), [style.literal(row.label) for row in rows])
    bars.invert_yaxis()
    bars.margins(x=0.25)
    for axes in (loops, bars):
        style.dress(axes)
    return loops, bars
