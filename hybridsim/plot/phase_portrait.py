"""This module draws one state against another, with stick highlighted and jumps dashed."""

from __future__ import annotations

from matplotlib.axes import Axes

from hybridsim.errors import UsageError
from hybridsim.plot.orbit import draw_orbit
from hybridsim.plot.shared.smooth_parts import refuse_arrays
from hybridsim.solution import Solution


def phase_portrait(
    solution: Solution,
    x: str | None = None,
    y: str | None = None,
    *,
    t_span: tuple[float, float] | None = None,
    axes: Axes | None = None,
) -> Axes:
    """Draw state `y` against state `x`, by default the first two.

    The colours show the modes. Pieces held by a surface are thick, or a dot if the point does not move.

    Parameters
    ----------
    t_span : part of the run; by default all, or the last few of very many periods (the title says so).
    axes : the axes to draw in; by default a new figure.
    """
    refuse_arrays(solution)
    names = [state.name for state in solution.model.states]
    if x is None or y is None:
        rest = [name for name in names if name not in (x, y)]
        missing = (x is None) + (y is None)
        if len(rest) < missing:
            raise UsageError(
                f"a phase portrait needs two states; {solution.model.name} has {', '.join(names) or 'none'}",
                remedy="draw a time history",
            )
        x = rest.pop(0) if x is None else x
        y = rest.pop(0) if y is None else y
    return draw_orbit(solution, x, y, t_span, axes)
