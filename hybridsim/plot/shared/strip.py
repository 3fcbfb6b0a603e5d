"""This module draws a strip of modes over time: one row per component, and a legend above."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.patches import Patch

from hybridsim.mechanics.declaration.system import MechanicalSystem
from hybridsim.plot.shared import style
from hybridsim.plot.shared.smooth_parts import Window
from hybridsim.presentation.mode_strip import bars_of
from hybridsim.solution import Solution

_HAIRLINE = 1.2  # points: the least width of a mode in a strip
_HEIGHT = 0.38  # half of a row that the bars take
_ROWS = (
    16  # pixels of the height of the bars on a page: the least height of a mode in a divided column is one
)


def changing_components(solution: Solution) -> list[str]:
    """Return the names of the components that have more than one mode."""
    if isinstance(solution.model, MechanicalSystem):
        return list(solution.modes)
    single = {component.name for component in solution.components if len(component.modes) == 1}
    return [name for name in solution.modes if name not in single]


def mode_colours_of(solution: Solution, components: Sequence[str]) -> dict[str, str]:
    """Return the colour of each mode of a strip with these components."""
    if isinstance(solution.model, MechanicalSystem):
        occurring = dict.fromkeys(interval.mode for name in components for interval in solution.modes[name])
        return style.colours_of(occurring, set())
    return style.mode_colours(solution.components)


def draw_strip(axis: Axes, solution: Solution, components: Sequence[str], window: Window) -> None:
    """Draw one row per component with its modes as colours; the legend names the modes that occur."""
    colours = mode_colours_of(solution, components)
    seen: dict[str, list[str]] = {}
    is_shared = False
    columns = _columns(axis)
    for row, component in enumerate(components):
        bars, shares = bars_of(solution.modes[component], window.t0, window.t1, columns, _ROWS)
        is_shared = is_shared or shares
        for mode in {bar.mode for bar in bars}:
            seen.setdefault(mode, []).append(component)
        corners = [
            [
                (x, row + _HEIGHT - 2 * _HEIGHT * y)
                for x, y in zip((b.start, b.end, b.end, b.start), (b.low, b.low, b.high, b.high))
            ]
            for b in bars
        ]
        faces = [colours[bar.mode] for bar in bars]
        axis.add_collection(PolyCollection(corners, facecolors=faces, linewidths=0))
    axis.set_ylim(len(components) - 0.5, -0.5)
    axis.set_yticks(range(len(components)), [style.literal(name) for name in components])
    axis.tick_params(axis="y", length=0, labelsize=9)
    axis.tick_params(axis="x", color=style.GREY, labelsize=9)
    axis.spines[["top", "right", "left"]].set_visible(False)
    axis.spines["bottom"].set_color(style.GREY)
    axis.set_xlim(window.t0, window.t1)
    used = [colours[mode] for mode in seen]
    handles = []
    for mode in (mode for mode in colours if mode in seen):
        # Two modes that share a colour are told apart by their components.
        whose = f" ({', '.join(seen[mode])})" if used.count(colours[mode]) > 1 else ""
        handles.append(Patch(color=colours[mode], label=style.literal(mode + whose)))
    if is_shared:
        handles.append(Patch(alpha=0.0, label="(a divided column: the share of each mode)"))
    style.legend_above(axis, handles)


def _columns(axis: Axes) -> int:
    """Return the largest number of visible vertical lines that fit into a mode strip."""
    whole = style.figure_of(axis)
    return max(20, int(72 * whole.get_figwidth() * axis.get_position().width / _HAIRLINE))
