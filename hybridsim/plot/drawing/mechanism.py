"""This module draws the mechanism of a model at one time of a run."""

from __future__ import annotations

from matplotlib.axes import Axes

from hybridsim.model.checks.units import time_unit
from hybridsim.plot.drawing.canvas import Canvas
from hybridsim.plot.drawing.theme import DARK, LIGHT
from hybridsim.plot.shared import style
from hybridsim.plot.shared.smooth_parts import refuse_arrays, window_of
from hybridsim.solution import Solution

_WIDTH, _LEAST, _MOST, _HEAD = 6.4, 1.2, 5.0, 0.3  # inches


def mechanism(
    solution: Solution, t: float | None = None, *, axes: Axes | None = None, dark: bool = False
) -> Axes:
    """Draw the mechanism at one time, as the `drawing` of its model declares it.

    The range shows the whole motion, so that pictures of one run at several times have the same scale.

    Parameters
    ----------
    t : the time; by default the end of the run.
    axes : by default a new figure.
    dark : whether the background is dark.
    """
    refuse_arrays(solution)
    canvas = Canvas(solution, window_of(solution, None), DARK if dark else LIGHT)
    if axes is None:
        figure = style.figure(_WIDTH, min(max(_WIDTH * canvas.aspect, _LEAST), _MOST) + _HEAD)
        figure.set_facecolor(canvas.theme.paper)
        axes = figure.subplots()
    canvas.prepare(axes)
    t = solution.t_end if t is None else float(t)
    for artist in canvas.artists(axes, t):
        axes.add_artist(artist)
    ink = canvas.theme.ink
    axes.set_title(f"t = {t:.4g} {time_unit(solution.model)}".rstrip(), fontsize=9, loc="left", color=ink)
    if handles := canvas.handles(t):
        axes.legend(
            handles=handles,
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            ncols=len(handles),
            frameon=False,
            fontsize=9,
            labelcolor=ink,
            handlelength=1.2,
            borderaxespad=0.2,
        )
    return axes
