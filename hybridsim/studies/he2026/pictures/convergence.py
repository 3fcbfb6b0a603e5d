"""This module draws figures 4 and 5: convergence of A and E with the step or the zero-velocity interval."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from hybridsim.plot.shared import style
from hybridsim.studies.he2026.measured.convergence import ALL_CASES, RIDGE, Curves
from hybridsim.studies.he2026.pictures.motions import column_title

_LINEAR = 0.01  # per cent: below it the scale is linear, to show zero and both signs
_LINES = {"r": "-", "N": "--", "F": ":"}


def convergence(curves: Curves, title: str, label: str, published: float) -> Figure:
    """Draw the relative errors of A and E over the settings; a column is a method, a line is a case."""
    methods = list(curves.values)
    figure = style.figure(min(2.6 * len(methods) + 0.6, style.BROAD), 5.4)
    style.put_title(
        figure, f"{title}\nlinear between -{_LINEAR:g} and {_LINEAR:g} % (grey), logarithmic beyond", size=10
    )
    panels = figure.subplots(2, len(methods), sharex=True, sharey="row", squeeze=False)
    count: dict[str, int] = {}
    looks = {}
    for case in ALL_CASES:
        group = "F0/N" if case == RIDGE else case[0]
        count[group] = count.get(group, -1) + 1
        looks[case] = (
            {"color": style.INK, "linewidth": 1.8}
            if case == RIDGE
            else {"color": style.PALETTE[count[group]], "linestyle": _LINES[group], "linewidth": 1.2}
        )
    for j, method in enumerate(methods):
        for i in range(2):
            axes = panels[i, j]
            for case, look in looks.items():
                values = curves.values[method][case][i] / curves.exact[case][i] - 1.0
                axes.plot(curves.settings, 100.0 * values, label=case, **look)
            axes.axvline(published, color=style.MARK, linewidth=1.0, zorder=0)
            axes.set_xscale("log")
            axes.set_yscale("symlog", linthresh=_LINEAR)
            axes.set_yticks([-100, -10, -1, -0.1, 0, 0.1, 1, 10, 100],
                            labels=["−100", "−10", "−1", "−0.1", "0", "0.1", "1", "10", "100"])  # fmt: skip
            style.dress(axes)
            axes.minorticks_off()
            axes.axhline(0.0, color=style.GREY, linewidth=0.8)
            axes.axhspan(-_LINEAR, _LINEAR, color="#e8e8e8", zorder=0)
        panels[0, j].set_title(_title(method), fontsize=9, loc="left")
        panels[1, j].set_xlabel(label, fontsize=9)
        if curves.name == "eps_v":
            panels[1, j].invert_xaxis()
    for i, quantity in enumerate("AE"):
        panels[i, 0].set_ylabel(f"{quantity} off the exact one [%]", fontsize=9)
        low = min(float(np.min(curves.values[m][c][i] / curves.exact[c][i])) for m in methods for c in looks)
        high = max(float(np.max(curves.values[m][c][i] / curves.exact[c][i])) for m in methods for c in looks)
        panels[i, 0].set_ylim(min(200.0 * (low - 1.0), -2 * _LINEAR), max(200.0 * (high - 1.0), 2 * _LINEAR))
    handles, _ = panels[0, 0].get_legend_handles_labels()
    style.legend_below(figure, handles)
    return figure


def _title(method: str) -> str:
    parts = method.split(", ")
    return f"{parts[0]}, {parts[2]}" if len(parts) > 2 else column_title(method)
