"""This module draws states and outputs over time, with a strip of modes and marks at the events."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.patches import Patch

from hybridsim.errors import UsageError
from hybridsim.mechanics.declaration.system import MechanicalSystem
from hybridsim.model.checks.units import time_unit
from hybridsim.plot import style
from hybridsim.plot.scale import label_axis
from hybridsim.plot.smooth_parts import (
    CUTS,
    SmoothPart,
    Window,
    event_times,
    extent,
    known_units,
    require_run,
    smooth_parts_of,
    unit_of,
    window_of,
)
from hybridsim.presentation.mode_strip import bars_of
from hybridsim.solution import Solution

_MOST_QUANTITIES = 4  # the default number of quantities, and of outputs
_MOST_COMPONENTS = 16  # rows of the strip of modes
_MOST_MARKS = 150  # event lines; more would merge into a grey area
_VISIBLE = 1e-3  # of the range: a smaller jump is invisible
_HAIRLINE = 1.2  # points: the least width of a mode in a strip
_ROW, _STRIP = 1.75, 0.34  # inches


@dataclass(frozen=True)
class TimeHistoryAxes:
    """The axes of a time history: one for each quantity, and one for the modes (None without components)."""

    quantities: tuple[Axes, ...]
    modes: Axes | None

    def _repr_png_(self) -> bytes:
        """Return the picture, which a notebook shows at the end of a cell."""
        return style.as_png(self)

    def __iter__(self) -> Iterator[Axes]:
        yield from self.quantities
        if self.modes is not None:
            yield self.modes


def time_history(
    solution: Solution,
    quantities: Sequence[str] | None = None,
    *,
    t_span: tuple[float, float] | None = None,
    axes: Sequence[Axes] | None = None,
) -> TimeHistoryAxes:
    """Draw quantities over time, one below the other, and the modes of all components under them.

    A jump (of a state at a reset, of an output at a change of mode) is dashed; thin lines mark the events. Of more
    than 16 components, as in a large `MechanicalSystem`, the strip shows the modes of the first 16.

    Parameters
    ----------
    quantities : names of states and outputs; by default the first four of both, and the first four outputs.
    t_span : part of the run; by default all, or the last few of very many periods (the title says so).
    axes : one per quantity, and one more if the model has components; by default a new figure.
    """
    require_run(solution)
    model = solution.model
    names = _unasked(solution) if quantities is None else list(quantities)
    units = [unit_of(solution, name) for name in names]
    window = window_of(solution, t_span)
    smooth_parts = smooth_parts_of(solution, names, window)
    components = list(solution.modes)[:_MOST_COMPONENTS]
    history = _axes(len(names), len(components), axes)
    marks = _marks_in(solution, window)
    for axis, name, unit in zip(history.quantities, names, units):
        _draw(axis, smooth_parts, name)
        _mark(axis, marks)
        style.dress(axis)
        label_axis(axis.yaxis, name, unit, *extent(smooth_parts, name))
        axis.set_xlim(window.t0, window.t1)
    if history.modes is not None:
        _strip(history.modes, solution, components, window)
    *upper, lowest = history
    for axis in upper:
        axis.tick_params(labelbottom=False)
    second = "" if isinstance(model, MechanicalSystem) else time_unit(model)
    label_axis(lowest.xaxis, "t", second, window.t0, window.t1)
    hidden = len(solution.modes) - len(components)
    note = f"the modes of {hidden} other components are not shown" if hidden else ""
    style.head([*upper, lowest][0], model.title or model.name, window.note, note)
    return history


def _unasked(solution: Solution) -> list[str]:
    """Return the quantities that are drawn by default: the first declared states, and the outputs."""
    names = list(known_units(solution))[:_MOST_QUANTITIES]
    outputs = [output.name for output in getattr(solution.model, "outputs", ())][:_MOST_QUANTITIES]
    return list(dict.fromkeys([*names, *outputs]))


def _marks_in(solution: Solution, window: Window) -> dict[str, np.ndarray]:
    """Return the times of the events in a window by kind; a near-grazing changes nothing and is left out."""
    found = {kind: event_times(solution, [kind]) for kind in CUTS}
    return {kind: times[(window.t0 <= times) & (times <= window.t1)] for kind, times in found.items()}


def _axes(quantities: int, components: int, axes: Sequence[Axes] | None) -> TimeHistoryAxes:
    count = quantities + bool(components)
    if axes is not None:
        all_axes = tuple(axes)
        if len(all_axes) != count:
            raise UsageError(
                f"{len(all_axes)} axes were passed for {quantities} quantities", remedy=f"use {count} axes"
            )
        return TimeHistoryAxes(all_axes[:quantities], all_axes[quantities] if components else None)
    heights = [_ROW] * quantities + [0.1 + _STRIP * components] * bool(components)
    figure = style.figure(9.0, 0.7 + sum(heights))
    grid = figure.subplots(count, 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights})
    made = tuple(grid[:, 0])
    figure.align_ylabels(made)
    return TimeHistoryAxes(made[:quantities], made[quantities] if components else None)


def _draw(axis: Axes, smooth_parts: Sequence[SmoothPart], name: str) -> None:
    """Draw a curve as one line that is interrupted at jumps; the jumps are a second, dashed line."""
    low, high = extent(smooth_parts, name)
    t, y, jump_t, jump_y = [smooth_parts[0].t], [smooth_parts[0].values[name]], [], []
    for before, after in itertools.pairwise(smooth_parts):
        left, right = before.values[name][-1], after.values[name][0]
        if abs(right - left) > _VISIBLE * (high - low):
            t.append(np.array([np.nan]))
            y.append(np.array([np.nan]))
            jump_t += [after.t[0], after.t[0], np.nan]
            jump_y += [left, right, np.nan]
        t.append(after.t)
        y.append(after.values[name])
    axis.plot(np.concatenate(t), np.concatenate(y), color=style.INK, linewidth=1.2, solid_joinstyle="round")
    if jump_t:
        axis.plot(jump_t, jump_y, color=style.INK, linewidth=0.8, linestyle=(0, (3, 2)))


def _mark(axis: Axes, marks: Mapping[str, np.ndarray]) -> None:
    """Draw a thin line at each event, unless there are too many, and a triangle at the top for monitors."""
    for times in marks.values():
        if len(times) <= _MOST_MARKS:
            for t in times.tolist():
                axis.axvline(t, color=style.MARK, linewidth=0.6, zorder=0.9)
    monitors = marks["monitor"].tolist()
    if 0 < len(monitors) <= _MOST_MARKS:
        at_top = axis.get_xaxis_transform()
        axis.plot(
            monitors,
            [1.0] * len(monitors),
            "v",
            color=style.INK,
            markersize=5,
            transform=at_top,
            clip_on=False,
        )


def _strip(axis: Axes, solution: Solution, components: Sequence[str], window: Window) -> None:
    """Draw one row per component with its modes as colours; the legend names the modes that occur."""
    if isinstance(solution.model, MechanicalSystem):
        occurring = dict.fromkeys(interval.mode for name in components for interval in solution.modes[name])
        colours = style.colours_of(occurring, set())
    else:
        colours = style.mode_colours(solution.components)
    seen: set[str] = set()
    is_shared = False
    columns = _columns(axis)
    for row, component in enumerate(components):
        bars, shares = bars_of(solution.modes[component], window.t0, window.t1, columns)
        is_shared = is_shared or shares
        seen |= {bar.mode for bar in bars}
        corners = [
            [
                (x, row + 0.38 - 0.76 * y)
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
    handles = [Patch(color=colours[name], label=style.literal(name)) for name in colours if name in seen]
    axis.legend(
        handles=handles,
        loc="lower left",  # it grows upwards, away from the labels of the time axis
        bbox_to_anchor=(1.005, 0.0),
        borderaxespad=0.3,
        frameon=False,
        fontsize=9,
        handlelength=1.2,
        title="a divided column:\nseveral short modes" if is_shared else None,
        title_fontsize=8,
        alignment="left",
    )


def _columns(axis: Axes) -> int:
    """Return the number of lines of the least visible width that fit into a strip."""
    whole = axis.get_figure(root=True)
    assert whole is not None
    return max(20, int(72 * whole.get_figwidth() * axis.get_position().width / _HAIRLINE))
