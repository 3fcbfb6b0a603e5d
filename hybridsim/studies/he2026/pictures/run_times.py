"""This module draws figures 6 and 7: run time and evaluations for a small interval, and for stick."""

from __future__ import annotations

from matplotlib.figure import Figure

from hybridsim.plot.shared import style
from hybridsim.studies.he2026.measured.convergence import CASES
from hybridsim.studies.he2026.measured.run_times import EPS, WITH, RunTimes
from hybridsim.studies.he2026.measured.settings import SIGNS
from hybridsim.studies.he2026.pictures.motions import column_title, plain_log


def interval_cost(times: RunTimes) -> Figure:
    """Draw the time increase t_d over eps_v for every case, and the number of right-hand side evaluations."""
    figure = style.figure(style.BROAD, 3.8)
    style.put_title(
        figure,
        f"Figure 6: cost of a smaller zero-velocity interval, mean of {times.repeats} runs of {times.periods} periods",
    )
    left, right = figure.subplots(1, 2, sharex=True)
    for k, method in enumerate(WITH):
        colour = style.PALETTE[k]
        for i, case in enumerate(CASES):
            label = column_title(method.name) if i == 0 else None
            costs = times.by_eps[method.name][case]
            more = [100.0 * (c.evaluations / costs[0].evaluations - 1.0) for c in costs]
            shares = [100.0 * value for value in times.t_d(method.name, case)]
            left.plot(EPS, shares, color=colour, linewidth=0.9, marker=".", label=label)
            right.plot(EPS, more, color=colour, linewidth=0.9, marker=".", label=label)
    left.text(0.02, 0.97, "paper: 120 % at 1e-7 (far above)", transform=left.transAxes, va="top", fontsize=9)
    left.set_ylabel("t_d, more run time than at 8e-4 [%]", fontsize=9)
    right.set_ylabel("more right-hand sides than at 8e-4 [%]", fontsize=9)
    for axes in (left, right):
        axes.set_xscale("log")
        axes.invert_xaxis()
        axes.set_xlabel("zero-velocity interval eps_v [m/s]", fontsize=9)
        style.dress(axes)
    style.legend_below(figure, left.get_legend_handles_labels()[0])
    return figure


def stick_cost(times: RunTimes) -> Figure:
    """Draw the run time in milliseconds for every method and case."""
    figure = style.figure(8.6, 4.2)
    style.put_title(figure, f"Figure 7: time of {times.periods} periods, mean of {times.repeats} runs")
    axes = figure.subplots()
    names = [*(v.name for v in SIGNS), *(v.name for v in WITH), "exact"]
    rows = list(range(len(CASES)))
    for k, name in enumerate(names):
        colour = style.INK if name == "exact" else style.PALETTE[k]
        values = [1e3 * times.by_method[name][case].seconds for case in CASES]
        title = "exact, with stick" if name == "exact" else column_title(name)
        axes.plot(values, rows, style.MARKERS[k], color=colour, markersize=6, label=title)
    base = [1e3 * 3.25 * times.by_method[SIGNS[0].name][case].seconds for case in CASES]
    axes.plot(base, rows, "|", color=style.GREY, markersize=12, label="paper: +225 % on sign by step")
    axes.set_yticks(rows, labels=list(CASES))
    axes.invert_yaxis()
    plain_log(axes.xaxis)
    axes.set_xlabel(f"time of {times.periods} periods [ms]", fontsize=9)
    style.dress(axes)
    style.legend_below(figure, axes.get_legend_handles_labels()[0])
    return figure
