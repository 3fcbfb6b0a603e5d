"""This module draws the mechanism of a model at one time of a run."""

from __future__ import annotations

from matplotlib.axes import Axes

from hybridsim.plot import style
from hybridsim.plot.drawing.canvas import Canvas
from hybridsim.plot.drawing.theme import DARK, LIGHT
from hybridsim.plot.smooth_parts import refuse_arrays, window_of
from hybridsim.solution import Solution

_WIDTH, _LEAST, _MOST = 6.4, 1.6, 5.0  # inches


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
        figure = style.figure(_WIDTH, min(max(_WIDTH * canvas.aspect, _LEAST), _MOST))
        figure.set_facecolor(canvas.theme.paper)
        axes = figure.subplots()
    canvas.prepare(axes)
    for artist in canvas.artists(axes, solution.t_end if t is None else float(t)):
        axes.add_artist(artist)
    return axes
