"""This module draws one quantity against another, for phase portraits and friction loops."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from hybridsim.plot.shared import style
from hybridsim.plot.shared.scale import label_axis, shared_powers
from hybridsim.plot.shared.smooth_parts import (
    SmoothPart,
    extent,
    smooth_parts_of,
    title_of,
    unit_of,
    window_of,
)
from hybridsim.solution import Solution

Points = NDArray[np.float64]

_HELD, _FREE = 3.0, 1.2  # line widths if a surface holds (stick), and otherwise
_DOT = 5.0  # size of an interval that stays at a point
_SLIM = 4.0  # ratio of two extents beyond which one scale would flatten the curve
_VISIBLE = 1e-3  # of the range: a smaller part is a point, a smaller jump is not drawn


def draw_orbit(
    solution: Solution, across: str, up: str, t_span: tuple[float, float] | None, axes: Axes | None
) -> Axes:
    """Draw the quantity `up` over `across` in the colours of the modes; held parts are thick, and jumps are dashed.

    The colours show the modes of the components that belong to the quantities, such as a contact whose force
    or velocity is drawn. If there is no such component, or several, the colour shows the mode of the first
    one, and a part is held if any component holds.
    """
    units = unit_of(solution, across), unit_of(solution, up)
    window = window_of(solution, t_span)
    smooth_parts = smooth_parts_of(solution, (across, up), window)
    if axes is None:
        axes = style.figure(6.2, 4.6).subplots()
    concerned = _concerned(solution, {across, up})
    smooth_parts = [
        replace(smooth_part, modes=_modes_of(smooth_part.modes, concerned)) for smooth_part in smooth_parts
    ]
    colours = style.mode_colours(solution.components)
    surfaces = {c.name: c.surface.hold for c in solution.components if c.surface}
    held_modes = set(surfaces.values())
    spans = [extent(np.concatenate([part.values[name] for part in smooth_parts])) for name in (across, up)]
    least = np.array([_VISIBLE * ((high - low) or 1.0) for low, high in spans])
    lines: dict[str, list[Points]] = {}
    dots: dict[str, list[Points]] = {}
    stretches, jumps = _stretches(smooth_parts, across, up, surfaces, least)
    for mode, points in stretches:
        stays = bool(np.all(np.ptp(points, axis=0) < least))
        (dots if stays else lines).setdefault(mode, []).append(points)
    for mode in dict.fromkeys([*lines, *dots]):
        colour = colours.get(mode, style.INK)
        width = _HELD if mode in held_modes else _FREE
        axes.add_collection(
            LineCollection(lines.get(mode, []), colors=colour, linewidths=width, capstyle="round")
        )
        if mode in dots:
            x, y = np.array([points[0] for points in dots[mode]]).T
            axes.plot(x, y, "o", color=colour, markersize=_DOT)
    axes.add_collection(
        LineCollection(jumps, colors=style.GREY, linewidths=0.9, linestyles=[(0, (3, 2))], zorder=1.5)
    )
    axes.autoscale_view()
    style.dress(axes)
    for mode, parts in lines.items():
        longest = max(parts, key=lambda points: float(np.hypot(*np.diff(points / least, axis=0).T).sum()))
        style.point_along(axes, longest[:, 0], longest[:, 1], colours.get(mode, style.INK))
    powers = shared_powers({name: (unit, *span) for name, unit, span in zip((across, up), units, spans)})
    for axis, name, unit, span in zip((axes.xaxis, axes.yaxis), (across, up), units, spans):
        title = title_of(solution.model, name)
        label_axis(axis, name, unit, *span, title=title, power=powers.get(name))
    if units[0] == units[1]:
        _equal_scales(axes, spans)
    # Of several components the colour of a held part belongs to the one that holds, and any other to the first.
    named = [mode for mode in colours if len(concerned) == 1 or mode not in held_modes]
    is_one_of_several = len(solution.components) > 1
    handles = [
        Line2D(
            [],
            [],
            color=colours[mode],
            linewidth=(_HELD if mode in held_modes else _FREE) if mode in lines else 0,
            marker="" if mode in lines else "o",
            markersize=_DOT,
            label=style.literal(f"{concerned[0]}: {mode}" if is_one_of_several and mode in named else mode),
        )
        for mode in colours
        if mode in lines or mode in dots
    ]
    if jumps:
        handles.append(Line2D([], [], color=style.GREY, linewidth=0.9, linestyle=(0, (3, 2)), label="jump"))
    if handles:
        axes.legend(handles=handles, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False, fontsize=9)
    model = solution.model
    style.head(axes, model.title or model.name, window.note)
    return axes


def _equal_scales(axes: Axes, spans: Sequence[tuple[float, float]]) -> None:
    """Draw both axes in one scale, so that a circle is round, unless one range is much smaller than the other."""
    wide, high = (high - low for low, high in spans)
    if wide > 0 and high > 0 and 1 / _SLIM < wide / high < _SLIM:
        axes.set_aspect("equal", adjustable="datalim")


def _concerned(solution: Solution, drawn: set[str]) -> list[str]:
    """Return the components that affect the drawn quantities, or all components if no component affects them."""
    forces = [contact.name for contact in solution.model.contacts if contact.name in drawn]
    moved = [contact.name for contact in solution.model.contacts if drawn & contact.velocity.names]
    return forces or moved or [component.name for component in solution.components]


def _modes_of(modes: Mapping[str, str], concerned: Sequence[str]) -> dict[str, str]:
    """Return the modes of the given components; an open contact has the mode "open" only."""
    return {
        name: "open" if modes.get(f"{name}_N") == "open" else mode
        for name, mode in modes.items()
        if name in concerned
    }


def _stretches(
    smooth_parts: Sequence[SmoothPart], across: str, up: str, surfaces: Mapping[str, str], least: Points
) -> tuple[list[tuple[str, Points]], list[tuple[Points, Points]]]:
    """Return the intervals of constant mode, and the jumps between them."""
    stretches: list[tuple[str, list[Points]]] = []
    jumps = []
    for smooth_part in smooth_parts:
        points = np.column_stack([smooth_part.values[across], smooth_part.values[up]])
        held = [mode for component, mode in smooth_part.modes.items() if surfaces.get(component) == mode]
        mode = (held or [*smooth_part.modes.values(), ""])[0]
        if stretches:
            last_mode, parts = stretches[-1]
            last = parts[-1][-1]
            if np.any(np.abs(points[0] - last) > least):
                jumps.append((last, points[0]))
            elif mode == last_mode:
                parts.append(points)
                continue
        stretches.append((mode, [points]))
    return [(mode, np.concatenate(parts)) for mode, parts in stretches], jumps
