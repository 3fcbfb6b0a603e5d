"""This module draws states and outputs over time, with a strip of modes and marks at the events."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from hybridsim.errors import UsageError
from hybridsim.mechanics.declaration.system import MechanicalSystem
from hybridsim.model.checks.units import time_unit
from hybridsim.plot.shared import style
from hybridsim.plot.shared.scale import label_axis, shared_powers
from hybridsim.plot.shared.smooth_parts import (
    CUTS,
    Samples,
    Window,
    event_times,
    extent,
    known_units,
    require_run,
    samples_of,
    title_of,
    unit_of,
    window_of,
)
from hybridsim.plot.shared.strip import changing_components, draw_strip, mode_colours_of
from hybridsim.plot.shared.symbols import symbol_of, unit_text
from hybridsim.solution import Solution

_MOST_QUANTITIES = 4  # the default number of quantities, and of outputs
_MOST_COMPONENTS = 16  # rows of the strip of modes
_MOST_MARKS = 150  # event lines; more would merge into a grey area
_MOST_NAMES = 4  # monitors that a legend names
_VISIBLE = 1e-3  # of the range: a smaller jump is invisible
_OVERLAID = 3  # quantities of one unit that share a panel
_ROW, _STRIP, _AROUND = 1.45, 0.3, 0.95  # inches
# Curves of one panel: black, and the palette without the colours of slip, which the strip of modes uses.
_CURVES, _DASHES = style.PALETTE[2:6], ("-", "--", ":")


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
    quantities: Sequence[str | Sequence[str]] | None = None,
    *,
    t_span: tuple[float, float] | None = None,
    axes: Sequence[Axes] | None = None,
) -> TimeHistoryAxes:
    """Draw quantities over time, one below the other, and the modes of all components under them.

    A jump (of a state at a reset, of an output at a change of mode) is dashed; thin lines mark the events. Of more
    than 16 components, as in a large `MechanicalSystem`, the strip shows the modes of the first 16.

    Parameters
    ----------
    quantities : names of states and outputs; a list of names is drawn in one panel. The default is the first four
        of both; three or more of them with one unit share a panel.
    t_span : part of the run; by default all, or the last few of very many periods (the title says so).
    axes : one per panel, and one more if a component has several modes; by default a new figure.
    """
    require_run(solution)
    model = solution.model
    panels = _unasked(solution) if quantities is None else [_names(one) for one in quantities]
    changing = changing_components(solution)
    if not all(panels) or not (panels or changing):
        raise UsageError("a panel has no quantity", remedy="use names of states, outputs, forces or inputs")
    names = list(dict.fromkeys(name for panel in panels for name in panel))
    units = {name: unit_of(solution, name) for name in names}
    window = window_of(solution, t_span)
    samples = samples_of(solution, names, window)
    components = changing[:_MOST_COMPONENTS]
    taken = mode_colours_of(solution, components).values() if components else ()
    history = _axes(len(panels), len(components), axes)
    marks = _marks_in(solution, window)
    extents = {name: extent(samples.values[name]) for name in names}
    powers = shared_powers({name: (units[name], *extents[name]) for name in names})
    above = 0.0
    for axis, panel in zip(history.quantities, panels, strict=True):
        looks = _looks(len(panel), taken)
        for name, (colour, dashes) in zip(panel, looks, strict=True):
            _draw(axis, samples, name, colour, dashes)
        _mark(axis, marks)
        style.dress(axis)
        low, high = zip(*(extents[name] for name in panel), strict=True)
        is_of_one_unit = len({units[name] for name in panel}) == 1
        unit, power = (units[panel[0]], powers.get(panel[0])) if is_of_one_unit else ("", None)
        label_axis(
            axis.yaxis, panel[0], unit, min(low), max(high), title=title_of(model, panel[0]), power=power
        )
        is_top = axis is history.quantities[0]
        handles = (
            _name_curves(axis, model, panel, [units[name] for name in panel], looks) if len(panel) > 1 else []
        )
        if is_top and 0 < len(marks["monitor"]) <= _MOST_MARKS:
            handles.append(_monitor_handle(solution, window))
        if handles:
            height = style.legend_above(axis, handles)
            above = height if is_top else above
        axis.set_xlim(window.t0, window.t1)
    if history.modes is not None:
        draw_strip(history.modes, solution, components, window)
    *upper, lowest = history
    for axis in upper:
        axis.tick_params(labelbottom=False)
    second = "" if isinstance(model, MechanicalSystem) else time_unit(model)
    label_axis(lowest.xaxis, "t", second, window.t0, window.t1, title="time")
    hidden = len(changing) - len(components)
    note = f"the modes of {hidden} other components are not shown" if hidden else ""
    style.head([*upper, lowest][0], model.title or model.name, window.note, note, above=above)
    return history


def _names(panel: str | Sequence[str]) -> list[str]:
    return [panel] if isinstance(panel, str) else list(panel)


def _unasked(solution: Solution) -> list[list[str]]:
    """Return the quantities that are drawn by default: the first declared states and outputs, and their panels."""
    units = known_units(solution)
    names = list(units)[:_MOST_QUANTITIES]
    outputs = [output.name for output in getattr(solution.model, "outputs", ())][:_MOST_QUANTITIES]
    names = list(dict.fromkeys([*names, *outputs]))
    panels: list[list[str]] = []
    for name in names:
        alike = [other for other in names if units[name] and units.get(other) == units[name]]
        if len(alike) < _OVERLAID:
            panels.append([name])
        elif name == alike[0]:
            panels.append(alike)
    return panels


def _looks(count: int, taken: Collection[str]) -> list[tuple[str, Any]]:
    """Return colours and dashes of the curves of a panel; a single curve is black, and taken colours are avoided."""
    if count == 1:
        return [(style.INK, "-")]
    colours = [style.INK, *([colour for colour in _CURVES if colour not in taken] or _CURVES)]
    return [(colours[k % len(colours)], _DASHES[k // len(colours) % len(_DASHES)]) for k in range(count)]


def _name_curves(
    axis: Axes, model: Any, panel: Sequence[str], units: Sequence[str], looks: Sequence[tuple[str, Any]]
) -> list[Line2D]:
    """Return the entries of a legend of several curves, and write the common part of their titles beside the panel.

    The unit is beside the panel if all curves have the same, otherwise behind each symbol.
    """
    is_shared = len(set(units)) == 1
    titles = [title_of(model, name).split() for name in panel]
    shared = " ".join(w[0] for w in itertools.takewhile(lambda w: len(set(w)) == 1, zip(*titles)))
    label = axis.yaxis.get_label_text()
    bracket = label[label.rindex("[") :] if label.endswith("]") else ""
    axis.yaxis.set_label_text("\n".join(filter(None, (shared, bracket))))
    handles = []
    for name, unit, (colour, dashes) in zip(panel, units, looks, strict=True):
        behind = f" [{unit_text(unit)}]" if unit and not is_shared else ""
        handles.append(Line2D([], [], color=colour, linestyle=dashes, label=symbol_of(name) + behind))
    return handles


def _monitor_handle(solution: Solution, window: Window) -> Line2D:
    """Return the entry of a legend for the triangles of monitors, with the direction of each monitor."""
    within = (e for e in solution.events if e.kind == "monitor" and window.t0 <= e.t <= window.t1)
    names = list(dict.fromkeys(event.component for event in within))
    directions = {one.name: one.direction for one in solution.model.monitors if one.direction != "both"}
    texts = [f"{name} ({directions[name]})" if name in directions else name for name in names]
    label = f"monitor{'s' if len(texts) > 1 else ''} {', '.join(texts[:_MOST_NAMES])}"
    label += ", …" if len(texts) > _MOST_NAMES else ""
    return Line2D([], [], color=style.INK, marker="v", markersize=5, linestyle="", label=style.literal(label))


def _marks_in(solution: Solution, window: Window) -> dict[str, np.ndarray]:
    """Return the event times in a window by kind, without near-grazings."""
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
    figure = style.figure(style.WIDTH, _AROUND + sum(heights))
    grid = figure.subplots(count, 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights})
    made = tuple(grid[:, 0])
    figure.align_ylabels(made)
    return TimeHistoryAxes(made[:quantities], made[quantities] if components else None)


def _draw(axis: Axes, samples: Samples, name: str, colour: str, dashes: Any) -> None:
    """Draw a curve as one line that is interrupted at jumps; the jumps are a second, dashed line."""
    t, y = samples.t, samples.values[name]
    low, high = extent(y)
    after = samples.firsts[1:-1]
    after = after[np.abs(y[after] - y[after - 1]) > _VISIBLE * (high - low)]
    axis.plot(
        np.insert(t, after, np.nan),
        np.insert(y, after, np.nan),
        color=colour,
        linestyle=dashes,
        linewidth=1.2,
        solid_joinstyle="round",
    )
    if len(after):
        gap = np.full(len(after), np.nan)
        axis.plot(
            np.column_stack([t[after], t[after], gap]).ravel(),
            np.column_stack([y[after - 1], y[after], gap]).ravel(),
            color=colour,
            linewidth=0.8,
            linestyle=(0, (3, 2)),
        )


def _mark(axis: Axes, marks: Mapping[str, np.ndarray]) -> None:
    """Draw a thin line at each event, unless there are too many events, and a triangle at the top for monitors."""
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
