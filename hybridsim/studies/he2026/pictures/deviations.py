"""This module draws maps of the deviation of a method that ignores stick, and the effect of the step."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke

from hybridsim.plot.shared import style
from hybridsim.studies.he2026.measured.deviation import EXACT, PUBLISHED, Maps
from hybridsim.studies.he2026.measured.settings import LITERAL, MATTERING, SIGNS, ZEROED
from hybridsim.studies.he2026.measured.step_study import EPS, STEPS, StepStudy
from hybridsim.studies.he2026.pictures.motions import column_title

_COLOURS = "cividis"  # lightness is ordered in the same way for all types of colour vision
_LOW, _HIGH = 0.3, 100.0  # per cent
_OUTLINE = [withStroke(linewidth=3.2, foreground="black")]  # white lines are then seen on yellow too


def edges(centres: np.ndarray) -> np.ndarray:
    """Return the borders of cells from their centres."""
    middle = 0.5 * (centres[1:] + centres[:-1])
    return np.concatenate(
        [[centres[0] - (middle[0] - centres[0])], middle, [centres[-1] + (centres[-1] - middle[-1])]]
    )


def deviation_maps(maps: Maps, quantity: str) -> Figure:
    """Draw the deviation (Eq. 9) over r and F0/N, from two interpretations of the paper and from the exact value."""
    columns = (LITERAL.name, ZEROED.name, EXACT)
    figure = style.figure(style.BROAD, 6.2)
    number = {"A": "10", "E": "11"}[quantity]
    style.put_title(
        figure,
        f"Figure {number}: {quantity}_D, the deviation of {quantity} without stick from {quantity} with it",
        size=10,
    )
    panels = figure.subplots(len(SIGNS), len(columns), sharex=True, sharey=True)
    x, y = edges(maps.r), edges(maps.ratios)
    mesh: Any = None
    for i, sign in enumerate(SIGNS):
        for j, name in enumerate(columns):
            axes: Axes = panels[i, j]
            values = 100.0 * maps.deviation(quantity, sign.name, name)
            mesh = axes.pcolormesh(
                x, y, np.clip(values, _LOW, _HIGH), norm=LogNorm(_LOW, _HIGH), cmap=_COLOURS, rasterized=True
            )
            _regions(axes, quantity)
            axes.set_title(f"{sign.name};\n{column_title(name)}", fontsize=9, loc="left")
            axes.tick_params(labelsize=9)
            axes.set_ylim(y[0], 0.70)
        panels[i, 0].set_ylabel("F0/N", fontsize=9)
    for axes in panels[-1]:
        axes.set_xlabel("frequency ratio r", fontsize=9)
    bar = figure.colorbar(mesh, ax=panels, label=f"{quantity}_D [%]", extend="both", shrink=0.9)
    bar.set_ticks([0.3, 1, 3, 10, 30, 100], labels=["0.3", "1", "3", "10", "30", "100"])
    bar.ax.minorticks_off()
    marks = [
        Line2D([], [], color="white", linestyle="-", linewidth=1.4, label="paper: 10 % and more"),
        Line2D([], [], color="white", linestyle="--", linewidth=1.4, label="paper: 5 % and more"),
        Line2D([], [], color="white", marker="x", linestyle="", label="paper: maximum"),
    ]
    legend = figure.legend(handles=marks, loc="outside lower center", ncols=3, fontsize=9, frameon=True)
    legend.get_frame().set_facecolor("#404060")
    for text in legend.get_texts():
        text.set_color("white")
    return figure


def _regions(axes: Axes, quantity: str) -> None:
    for level, line in (("above 10 %", "-"), ("above 5 %", "--")):
        (low, high), (left, right) = PUBLISHED[quantity][level]["F0/N"], PUBLISHED[quantity][level]["r"]
        look: dict[str, Any] = {
            "edgecolor": "white",
            "linestyle": line,
            "linewidth": 1.4,
            "path_effects": _OUTLINE,
        }
        axes.add_patch(Rectangle((left, low), right - left, high - low, fill=False, **look))
    ratio, r = PUBLISHED[quantity]["at"]
    axes.plot([r], [ratio], "x", color="white", markersize=6, markeredgewidth=1.6, path_effects=_OUTLINE)


def step_lines(study: StepStudy) -> Figure:
    """Draw the deviation along the published ridge over the step and over the velocity interval."""
    figure = style.figure(style.BROAD, 4.0)
    style.put_title(
        figure,
        "Deviation of A from the exact motion, root mean square over ten places along the published ridge",
        size=10,
    )
    left, right = figure.subplots(1, 2)
    for k, sign in enumerate(SIGNS):
        colour, marker = style.PALETTE[k], style.MARKERS[k]
        left.loglog(STEPS, 100.0 * study.along(sign.name, "A"), color=colour, marker=marker, label=sign.name)
        worst = 100.0 * study.worst[sign.name].max(axis=0)
        left.loglog(STEPS, worst, color=colour, linestyle=":", label=f"{sign.name}, worst period and place")
    base = 100.0 * study.along(SIGNS[0].name, "A")[0]
    left.loglog(
        STEPS, base * STEPS[0] / np.array(STEPS), color=style.GREY, linestyle="--", label="first order"
    )
    left.set_xlabel("steps per period, h0", fontsize=9)
    left.set_xticks(STEPS, labels=[str(s) for s in STEPS])
    left.set_title("without stick", fontsize=10, loc="left")
    for k, variant in enumerate(MATTERING):
        name = ", ".join((variant.name.split(",")[0], variant.name.split(", ")[2]))
        right.loglog(
            EPS, 100.0 * study.along_eps(variant.name, "A"), color=style.PALETTE[k + 2],
            marker=style.MARKERS[k + 2], label=name,
        )  # fmt: skip
    right.set_xlabel("zero-velocity interval eps_v [µm/s]", fontsize=9)
    right.set_title("with stick, h0 = 1200", fontsize=10, loc="left")
    left.set_ylim(bottom=0.25 * left.get_ylim()[0])  # room for the legends
    right.set_ylim(top=8.0 * right.get_ylim()[1])
    right.set_xticks(EPS, labels=[f"{1e6 * eps:g}" for eps in EPS])
    for axes, place in ((left, "lower left"), (right, "upper left")):
        axes.set_ylabel("deviation [%]", fontsize=9)
        style.dress(axes)
        axes.minorticks_off()
        axes.legend(fontsize=9, frameon=False, loc=place)
    return figure
