"""One state against another, stick drawn apart and jumps dashed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hybridsim.errors import UsageError
from hybridsim.plot.orbit import draw_orbit
from hybridsim.plot.pieces import refuse_arrays

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from hybridsim.solution import Solution


def phase_portrait(
    solution: Solution,
    x: str | None = None,
    y: str | None = None,
    *,
    t_span: tuple[float, float] | None = None,
    axes: Axes | None = None,
) -> Axes:
    """Draw state `y` against state `x` (the first two if not given).

    The colours are those of the modes. What a surface holds is thick, or a dot where it does not move at all.

    Parameters
    ----------
    t_span : part of the run; if not given all, or the last few of very many periods (the title says so).
    axes : where to draw; a new figure if not given.
    """
    refuse_arrays(solution)
    names = [state.name for state in solution.model.states]
    if x is None or y is None:
        rest = [name for name in names if name not in (x, y)]
        needed = (x is None) + (y is None)
        if len(rest) < needed:
            raise UsageError(
                f"a phase portrait needs two states; {solution.model.name} has {', '.join(names) or 'none'}",
                remedy="draw a time history",
            )
        x = rest.pop(0) if x is None else x
        y = rest.pop(0) if y is None else y
    return draw_orbit(solution, x, y, t_span, axes)
