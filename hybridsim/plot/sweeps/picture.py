"""This module draws a sweep: lines over one parameter, or maps over two."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.axes import Axes

from hybridsim.plot.sweeps.lines import sweep_lines
from hybridsim.plot.sweeps.map import sweep_map

if TYPE_CHECKING:
    from hybridsim.analysis import Sweep


def sweep(result: Sweep, *names: str, over: str | None = None) -> tuple[Axes, ...]:
    """Draw results of a sweep; by default up to six numerical results.

    A parameter of texts, such as the direction of `hs.bifurcation`, is not an axis: its readings are separate
    lines. Arrays at each point are drawn as dots, as in a bifurcation diagram.

    Parameters
    ----------
    over : the parameter on the horizontal axis. With it, or with one parameter only, the picture shows lines,
    one for each value of the other parameter; without it two parameters make a map.
    """
    if is_map(result, over):
        return sweep_map(result, *names)
    return sweep_lines(result, *names, over=over)


def is_map(result: Sweep, over: str | None) -> bool:
    """Return whether the picture of a sweep is a map over both parameters."""
    has_texts = any(values.dtype.kind != "f" for values in result.axes.values())
    return over is None and len(result.axes) == 2 and result.mode == "grid" and not has_texts
