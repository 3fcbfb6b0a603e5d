"""This module draws the records of a fit: measured samples, the fitted run, and the residuals below."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hybridsim.model.checks.units import time_unit
from hybridsim.plot.shared import style
from hybridsim.plot.shared.scale import label_axis
from hybridsim.plot.shared.smooth_parts import Window, samples_of, unit_of, window_of

if TYPE_CHECKING:
    from hybridsim.analysis import Fit
    from hybridsim.solution import Solution

_MOST_RECORDS = 3


def fit(result: Fit) -> Figure:
    """Draw each quantity of the first three records: samples, fitted run and residuals.

    Parameters
    ----------
    result : Fit
        The result of `hybridsim.fit`.

    Returns
    -------
    Figure
        The figure.
    """
    records = result.records[:_MOST_RECORDS]
    most = max(len(record.columns) for record in records)
    solutions = [result.solution(k) for k in range(len(records))]
    windows = [window_of(solution, None) for solution in solutions]
    whole = style.figure(max(6.4, 4.2 * len(records)), 0.6 + 3.0 * most)
    grid = whole.add_gridspec(2 * most, len(records), height_ratios=[2.4, 1.1] * most)
    for column, record in enumerate(records):
        for row, name in enumerate(record.columns):
            upper = whole.add_subplot(grid[2 * row, column])
            lower = whole.add_subplot(grid[2 * row + 1, column], sharex=upper)
            samples = record.t, record.columns[name], result.residuals[column][name]
            _draw((upper, lower), solutions[column], windows[column], samples, name)
            which = f"record {column + 1} of {len(result.records)}" if len(result.records) > 1 else ""
            if row == 0:
                style.head(upper, ": ".join(filter(None, [which, windows[column].note])))
    values = ", ".join(
        f"{name} = {value:.4g} ± {result.errors[name]:.1g}" for name, value in result.values.items()
    )
    style.put_title(whole, style.literal(f"{result.model.title or result.model.name}\n{values}"), size=10)
    return whole


def _draw(
    axes: tuple[Axes, Axes], solution: Solution, window: Window, samples: tuple[np.ndarray, ...], name: str
) -> None:
    upper, lower = axes
    inside = (samples[0] >= window.t0) & (samples[0] <= window.t1) & np.isfinite(samples[1])
    t, measured, residual = (each[inside] for each in samples)
    fitted = samples_of(solution, [name], window)
    line = fitted.values[name]
    unit = unit_of(solution, name)
    upper.plot(fitted.t, line, color=style.PALETTE[0], linewidth=1.3, label="fitted")
    upper.plot(t, measured, "o", color=style.INK, markersize=2.4, label="measured")
    upper.legend(
        fontsize=9, frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1
    )
    shown = np.concatenate([measured, line])
    label_axis(upper.yaxis, name, unit, float(shown.min()), float(shown.max()))
    upper.tick_params(labelbottom=False)
    lower.plot(t, residual, "o", color=style.INK, markersize=2.0)
    lower.axhline(0.0, color=style.GREY, linewidth=0.8)
    label_axis(lower.yaxis, "error", unit, residual.min(initial=0.0), residual.max(initial=0.0))
    label_axis(lower.xaxis, "t", time_unit(solution.model), window.t0, window.t1)
    for each in axes:
        style.dress(each)
