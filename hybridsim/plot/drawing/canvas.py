"""This module puts the drawing of a run on axes of matplotlib."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from matplotlib.text import Text
from numpy.typing import NDArray

from hybridsim.model.parts.model import Model
from hybridsim.plot.drawing.frame import Frame
from hybridsim.plot.drawing.kinds import items_of
from hybridsim.plot.drawing.layout import layout_of
from hybridsim.plot.drawing.outlines import Label, Outline, box_of
from hybridsim.plot.drawing.poses import Poses, poses_at
from hybridsim.plot.drawing.theme import Theme
from hybridsim.plot.shared import style
from hybridsim.plot.shared.scale import with_prefix
from hybridsim.plot.shared.smooth_parts import Window, mode_lookup
from hybridsim.solution import Solution

Points = NDArray[np.float64]

_SAMPLES = 80  # times at which the extent of the motion is determined
_BELOW = 0.09  # height of the bar of the scale, relative to the extent
_MARGIN = 0.25  # around the drawing, relative to the unit


class Canvas:
    """The drawing of a run: `frame` prepares the axes, and `artists` returns the artists at one time."""

    def __init__(self, solution: Solution, window: Window, theme: Theme) -> None:
        self.solution, self.theme = solution, theme
        samples = poses_at(solution, np.linspace(window.t0, window.t1, _SAMPLES))
        self.layout = layout_of(samples)
        self.modes = mode_lookup(solution)
        self.colours = style.mode_colours(solution.components)
        points = [
            item.points[np.isfinite(item.points).all(axis=1)]
            for poses in samples
            for item in items_of(Frame(poses, self.layout, theme, {}))
            if isinstance(item, Outline)
        ]
        low, high = box_of(points)
        margin = _MARGIN * min(self.layout.unit, 0.2 * float(np.max(high - low)))
        self.low, self.high = low - margin, high + margin
        self.unit = _unit_of(solution.model)
        if self.unit:
            self.low[1] -= _BELOW * float(np.max(high - low))

    @property
    def aspect(self) -> float:
        """Return the ratio of the drawing's height to its width."""
        width, height = self.high - self.low
        return float(height / width)

    def prepare(self, axes: Axes) -> None:
        """Set the limits and an equal aspect ratio of the axes, and draw a scale bar."""
        axes.set_xlim(self.low[0], self.high[0])
        axes.set_ylim(self.low[1], self.high[1])
        axes.set_aspect("equal")
        axes.set_axis_off()
        if self.unit:
            width, below = float(self.high[0] - self.low[0]), _BELOW * float(np.max(self.high - self.low))
            power = 10.0 ** np.floor(np.log10(0.2 * width))
            length = float(max(factor * power for factor in (1, 2, 5) if factor * power <= 0.2 * width))
            x, y = self.high[0] - 0.02 * width, self.low[1] + 0.25 * below
            axes.plot([x - length, x], [y, y], color=self.theme.weak, linewidth=2.0, solid_capstyle="butt")
            text = style.literal(with_prefix(length, self.unit))
            axes.text(
                x - length / 2,
                y + 0.2 * below,
                text,
                color=self.theme.ink,
                fontsize=8,
                ha="center",
                va="bottom",
            )

    def artists(self, axes: Axes, t: float, poses: Poses | None = None) -> Iterator[Artist]:
        """Yield the artists of the drawing at one time, in the order of drawing; they are not yet in the axes."""
        poses = poses or poses_at(self.solution, np.array([t]))[0]
        frame = Frame(poses, self.layout, self.theme, self._colours_at(t))
        items = list(items_of(frame))
        outlines = sorted((item for item in items if isinstance(item, Outline)), key=lambda item: item.order)
        for style_of, group in itertools.groupby(outlines, key=Outline.style):
            yield _patch([outline.points for outline in group], *style_of)
        yield from (_text(item) for item in items if isinstance(item, Label))

    def handles(self, t: float) -> list[Patch]:
        """Return entries for a legend: the components whose modes are shown, with their modes at one time."""
        modes = self.modes(t)
        shown = dict.fromkeys(
            shape.mode_of for shape in self.solution.model.drawing if shape.mode_of in modes
        )
        return [
            Patch(
                color=self.theme.mode(self.colours[modes[name]]),
                label=style.literal(f"{name}: {modes[name]}"),
            )
            for name in shown
        ]

    def _colours_at(self, t: float) -> dict[str, str]:
        """Return the mode colour of each shape that shows a mode."""
        modes = self.modes(t)
        return {
            shape.name: self.theme.mode(self.colours[modes[shape.mode_of]])
            for shape in self.solution.model.drawing
            if shape.mode_of in modes
        }


def _unit_of(model: Model) -> str:
    """Return the common unit of the states that are coordinates of shapes, or an empty text if there is none."""
    states = {state.name: state.unit for state in model.states}
    coordinates = [expr.text for shape in model.drawing for expr in (shape.at or ())]
    found = {states[name] for name in coordinates if name in states}
    return found.pop() if len(found) == 1 else ""


def _patch(parts: list[Points], order: float, line: str | None, width: float, fill: str | None) -> Artist:
    """Return lines or filled outlines of one style as one artist."""
    paths = [Path(np.vstack([part, part[:1]]) if fill else part, closed=fill is not None) for part in parts]
    return PathPatch(
        Path.make_compound_path(*paths),
        facecolor=fill or "none",
        edgecolor=line or "none",
        linewidth=width,
        capstyle="butt" if width > 4 else "round",
        joinstyle="round",
        zorder=order,
    )


def _text(label: Label) -> Artist:
    text = style.literal(label.text)
    return Text(
        float(label.point[0]),
        float(label.point[1]),
        text,
        color=label.colour,
        fontsize=9,
        ha="center",
        va="center",
        zorder=3,
    )
