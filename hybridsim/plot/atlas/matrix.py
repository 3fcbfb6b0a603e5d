"""This module draws the matrix of the atlas: test cases against integrators, with verdict symbols."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from hybridsim.plot.shared import style
from hybridsim.testing.verdict import (
    ERROR,
    HANG,
    NOT_RUN,
    REFUSED,
    RIGHT,
    WRONG_ANSWER,
    WRONG_SEQUENCE,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from hybridsim.testing.atlas import Atlas

# Verdict -> fill, symbol, colour of the symbol. Harmless verdicts are light and others dark, so that grey
# prints work.
LOOKS = {
    RIGHT: ("#cfe8dd", "✓", "#00664b"),
    WRONG_ANSWER: ("#D55E00", "✗", "white"),
    WRONG_SEQUENCE: ("#8a3a78", "≠", "white"),
    HANG: ("#222222", "∞", "white"),
    REFUSED: ("#e9e9e9", "–", "#555555"),
    ERROR: ("#F0E442", "!", "#222222"),
    NOT_RUN: ("white", "", "#999999"),
}
_CELL = 0.19  # inches, like the margins; the top margin holds the names of integrators
_LEFT, _RIGHT, _TOP, _BOTTOM = 2.0, 0.1, 1.7, 0.7
_TALL = 40  # from this number of rows on, the names are repeated below
_NARROWEST = 3.0  # inches that the legend needs


def matrix(result: Atlas) -> Axes:
    """Draw the matrix, with one row per test case, grouped by class, and one column per integrator."""
    groups = result.by_class()
    rows = sum(len(scenes) for scenes in groups.values()) + len(groups)
    columns = len(result.configurations)
    inner = max(columns * _CELL, _NARROWEST)
    below = _BOTTOM + (_TOP if rows > _TALL else 0.0)
    width, height = _LEFT + inner + _RIGHT, _TOP + rows * _CELL + below
    figure = Figure(figsize=(width, height))
    axes = figure.add_axes((_LEFT / width, below / height, inner / width, rows * _CELL / height))
    axes.set_xlim(0, inner / _CELL)
    axes.set_ylim(rows, 0)
    y, heights, names = 0, [], []
    for trouble, scenes in groups.items():
        axes.text(0.0, y + 0.72, trouble or "scenes", fontsize=9, fontweight="bold", va="baseline")
        y += 1
        for scene in scenes:
            for x, cell in enumerate(result.row(scene)):
                fill, symbol, ink = LOOKS[cell.verdict]
                axes.add_patch(Rectangle((x + 0.04, y + 0.04), 0.92, 0.92, facecolor=fill))
                axes.text(
                    x + 0.5,
                    y + 0.53,
                    symbol,
                    fontsize=8,
                    color=ink,
                    ha="center",
                    va="center",
                    fontweight="bold",
                )
            heights.append(y + 0.5)
            names.append(scene.name)
            y += 1
    axes.set_yticks(heights, [style.literal(name) for name in names], fontsize=7)
    labels = [style.literal(one.name) for one in result.configurations]
    axes.set_xticks([x + 0.5 for x in range(columns)], labels, fontsize=8, rotation=90)
    axes.xaxis.tick_top()
    axes.tick_params(length=0, labelbottom=rows > _TALL)
    axes.spines[:].set_visible(False)
    shown = {cell.verdict for cell in result.cells.values()}
    figure.legend(
        handles=[
            Patch(facecolor=fill, edgecolor=style.MARK, label=f"{symbol}  {verdict}".strip())
            for verdict, (fill, symbol, _) in LOOKS.items()
            if verdict in shown
        ],
        loc="lower center",
        ncols=3,
        frameon=False,
        fontsize=8,
    )
    return axes
