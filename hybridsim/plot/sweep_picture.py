"""A sweep as a picture: lines over one parameter, maps over two."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hybridsim.plot.sweep_lines import sweep_lines
from hybridsim.plot.sweep_map import sweep_map

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from hybridsim.analysis import Sweep


def sweep(result: Sweep, *names: str, over: str | None = None) -> tuple[Axes, ...]:
    """Draw readings of a sweep; all that are numbers, if none is named, up to six.

    A parameter of texts, such as the direction of `hs.bifurcation`, does not run across: its readings are lines, and
    arrays at each point dots, the diagram of a bifurcation.

    Parameters
    ----------
    over : the parameter that runs across. With it, or with one parameter only, there are lines, one for each value
        of the other parameter; without it two parameters make a map.
    """
    if is_map(result, over):
        return sweep_map(result, *names)
    return sweep_lines(result, *names, over=over)


def is_map(result: Sweep, over: str | None) -> bool:
    """Whether the picture has both parameters as axes."""
    has_texts = any(values.dtype.kind != "f" for values in result.axes.values())
    return over is None and len(result.axes) == 2 and result.mode == "grid" and not has_texts
