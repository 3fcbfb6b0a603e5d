"""This module draws the fits of several friction laws: measured samples, one run per law, and the residuals below."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from hybridsim.model.checks.units import time_unit
from hybridsim.plot.shared import style
from hybridsim.plot.shared.scale import label_axis
from hybridsim.plot.shared.smooth_parts import Window, samples_of, unit_of

if TYPE_CHECKING:
    from hybridsim.analysis import LawFits

_LINES = ("-", "--", "-.", ":")


def law_fits(result: LawFits) -> Figure:
    """Draw the first quantity of the first record under each law, and the residuals.

    Parameters
    ----------
    result : LawFits
        The result of `hybridsim.fit_laws`.

    Returns
    -------
    Figure
        The figure.
    """
    record = result.rows[0].fit.records[0]
    name = next(iter(record.columns))
    measured = record.columns[name]
    figure = style.figure(7.0, 5.0)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.4, 1.1))
    upper.plot(record.t, measured, "o", color=style.INK, markersize=2.4, label="measured")
    values, largest = [measured[np.isfinite(measured)]], 0.0
    for k, row in enumerate(result.rows):
        colour, solution = style.PALETTE[k % len(style.PALETTE)], row.fit.solution(0)
        window = Window(max(float(record.t[0]), solution.t_start), solution.t_end)
        samples, residual = samples_of(solution, [name], window), row.fit.residuals[0][name]
        line = samples.values[name]
        label = style.literal(row.label)
        upper.plot(samples.t, line, color=colour, linewidth=1.3, linestyle=_LINES[k % 4], label=label)
        lower.plot(record.t, residual, "o", color=colour, markersize=2.0)
        values.append(line)
        largest = max(largest, float(np.nanmax(np.abs(residual))))
    model, solution = result.rows[0].fit.model, result.rows[0].fit.solution(0)
    upper.legend(fontsize=9, frameon=False, ncols=4, loc="lower right", bbox_to_anchor=(1.0, 1.0))
    whole = np.concatenate(values)
    label_axis(upper.yaxis, name, unit_of(solution, name), float(whole.min()), float(whole.max()))
    label_axis(lower.yaxis, "error", unit_of(solution, name), -largest, largest)
    label_axis(lower.xaxis, "t", time_unit(model), float(record.t[0]), float(record.t[-1]))
    lower.axhline(0.0, color=style.GREY, linewidth=0.8)
    for axes in (upper, lower):
        style.dress(axes)
    return figure
