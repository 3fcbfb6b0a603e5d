"""This module draws figures 8 and 9: A/A0 and E/E0 over F0 at fixed F0/N."""

from __future__ import annotations

from matplotlib.figure import Figure

from hybridsim.plot import style
from hybridsim.studies.he2026.measured.reduction import (
    EXACT,
    FORCES,
    METHODS,
    RATIOS,
    STRIBECK,
    STRIBECK_RATIOS,
    Reduction,
)
from hybridsim.studies.he2026.pictures.motions import column_title


def reduction(found: Reduction) -> Figure:
    """Draw one line for each F0/N; a line is flat if the results depend only on r and F0/N."""
    names = [*(v.name for v in METHODS), EXACT, STRIBECK]
    figure = style.figure(2.3 * len(names) + 0.4, 4.8)
    style.put_title(figure, "Figures 8 and 9: A/A0 and E/E0 at r = 0.6 as F0 grows at fixed F0/N")
    panels = figure.subplots(2, len(names), sharex=True, sharey="row", squeeze=False)
    for j, name in enumerate(names):
        for i, table in enumerate((found.A, found.E)):
            axes = panels[i, j]
            for k, ratio in enumerate(STRIBECK_RATIOS if name == STRIBECK else RATIOS):
                colour = style.PALETTE[RATIOS.index(ratio)]
                axes.plot(
                    FORCES, table[name][k], color=colour, marker=".", linewidth=1.1, label=f"F0/N = {ratio:g}"
                )
            axes.set_xscale("log")
            style.dress(axes)
        panels[0, j].set_title(column_title(name), fontsize=9, loc="left")
        panels[1, j].set_xlabel("F0 [N]", fontsize=9)
    panels[0, 0].set_ylabel("A/A0", fontsize=9)
    panels[1, 0].set_ylabel("E/E0", fontsize=9)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(RATIOS), frameon=False, fontsize=9)
    return figure
