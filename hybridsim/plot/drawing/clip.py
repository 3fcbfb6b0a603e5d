"""This module makes the frames of an animation: mechanism, curves, modes, and a line at the current time."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.lines import Line2D
from matplotlib.text import Text
from numpy.typing import NDArray

from hybridsim.errors import UsageError
from hybridsim.model.checks.units import time_unit
from hybridsim.plot.drawing.canvas import Canvas
from hybridsim.plot.drawing.poses import poses_at
from hybridsim.plot.drawing.theme import DARK, Theme, darken
from hybridsim.plot.shared import style
from hybridsim.plot.shared.smooth_parts import Window, require_length
from hybridsim.plot.shared.strip import changing_components
from hybridsim.plot.time_history import time_history
from hybridsim.solution import Solution

Picture = NDArray[np.uint8]

MOST_FRAMES = 1000
_WIDTH, _DRAWN, _CURVE, _ROW = 6.4, 3.2, 0.95, 0.22  # inches: the whole, the drawing, a curve, a row of modes
_HEAD = 0.48  # inches: the title and the time
_TALL = 0.9  # a drawing that is higher than this part of its width is put to the left of the curves
_SECONDS = 8.0  # length of an animation whose speed is not declared


class Clip:
    """An animation of a run: its times, its speed, and the pictures at these times."""

    def __init__(
        self,
        solution: Solution,
        quantities: Sequence[str],
        window: Window,
        speed: float | None,
        fps: float,
        theme: Theme,
    ) -> None:
        require_length(window)
        span = window.t1 - window.t0
        self.speed = speed or _round_speed(span / _SECONDS, time_unit(solution.model) == "s")
        count = max(2, math.floor(span / self.speed * fps + 1e-9) + 1)
        if count > MOST_FRAMES:
            least = span * fps / (MOST_FRAMES - 1)
            raise UsageError(
                f"the animation would have {count} frames, more than {MOST_FRAMES}",
                remedy=f"use speed={least:.3g} or more, a shorter t_span, or a lower fps",
            )
        self.fps, self.theme = fps, theme
        self.palette = [*theme.colours, *map(theme.mode, style.mode_colours(solution.components).values())]
        self.times = np.linspace(window.t0, min(window.t0 + (count - 1) * self.speed / fps, window.t1), count)
        self._solution = solution
        self._canvas = Canvas(solution, window, theme)
        self._build(quantities, window)

    def _build(self, names: Sequence[str], window: Window) -> None:
        """Make the figure with all parts that do not move."""
        solution = self._solution
        changing = len(changing_components(solution))
        rows = len(names) + bool(changing)
        heights = [_CURVE] * len(names) + [0.1 + _ROW * changing] * bool(changing)
        aspect = self._canvas.aspect
        is_tall = aspect > _TALL and rows > 0
        height = min(_WIDTH * aspect, _DRAWN)
        curved = (0.55 + sum(heights)) * bool(rows)
        if is_tall:
            height, curved = max(height, curved), 0.0
        ratios = [_HEAD, height, curved] if curved else [_HEAD, height]
        self.figure = style.figure(_WIDTH, sum(ratios))
        self._head, drawn_in, *below = self.figure.subfigures(
            len(ratios), 1, squeeze=False, height_ratios=ratios
        )[:, 0]
        if is_tall:
            width = min(max(height / aspect, 1.5), 0.5 * _WIDTH)
            drawn_in, *below = drawn_in.subfigures(1, 2, squeeze=False, width_ratios=[width, _WIDTH - width])[
                0
            ]
        FigureCanvasAgg(self.figure)
        self._drawn: Axes = drawn_in.subplots()
        self._canvas.prepare(self._drawn)
        self._curves: list[Axes] = []
        if below:
            grid = below[0].subplots(
                rows, 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights}
            )
            self._curves = list(grid[:, 0])
            time_history(solution, names, t_span=(window.t0, window.t1), axes=self._curves)
            for axes in self._curves:  # a curve is too low for a title besides its symbol
                *_, symbol = axes.get_ylabel().split("\n")
                if not symbol.startswith("["):
                    axes.set_ylabel(symbol, fontsize=9)
            below[0].align_ylabels(self._curves)
            for axes in self._curves:
                axes.set_title("", loc="left")
        title = style.literal(textwrap.shorten(solution.model.title or solution.model.name, 80))
        self._head.text(0.01, 0.88, title, fontsize=10, ha="left", va="top")
        if self.theme is DARK:
            darken(self.figure)
        self._cursors = [
            Line2D(
                [0, 0], [0, 1], color=self.theme.force, linewidth=1.2, transform=axes.get_xaxis_transform()
            )
            for axes in self._curves
        ]
        self._dots = [np.asarray(solution.output(name, self.times)) for name in names]

    def pictures(self) -> Iterator[Picture]:
        """Yield the pictures (h, w, 3) at all times."""
        canvas = self.figure.canvas
        assert isinstance(canvas, FigureCanvasAgg)
        canvas.draw()
        still = canvas.copy_from_bbox(self.figure.bbox)
        poses = poses_at(self._solution, self.times)
        unit, note = time_unit(self._solution.model), _how_fast(self.speed, time_unit(self._solution.model))
        span = float(np.ptp(self.times))
        for k, t in enumerate(self.times):
            canvas.restore_region(still)
            clock = f"t = {_short(float(t), span)} {unit}".rstrip() + f"   {note}"
            moving = [*self._canvas.artists(self._drawn, float(t), poses[k]), self._clock(clock)]
            for artist in moving:
                _draw(artist, self._drawn, canvas)
            for axes, cursor in zip(self._curves, self._cursors):
                cursor.set_xdata([t, t])
                _draw(cursor, axes, canvas)
            for axes, values in zip(self._curves, self._dots):
                dot = Line2D([t], [values[k]], marker="o", markersize=4.5, color=self.theme.force)
                _draw(dot, axes, canvas)
            yield np.asarray(canvas.buffer_rgba())[..., :3].copy()

    def _clock(self, text: str) -> Text:
        at = self._head.transSubfigure
        return Text(0.01, 0.05, text, transform=at, color=self.theme.ink, fontsize=9, ha="left", va="bottom")


def _draw(artist: Artist, axes: Axes, canvas: FigureCanvasAgg) -> None:
    """Draw an artist that is not in the axes."""
    if not artist.is_transform_set():
        artist.set_transform(axes.transData)
    artist.set_figure(canvas.figure)
    artist.draw(canvas.get_renderer())


def _round_speed(speed: float, has_seconds: bool) -> float:
    """Round a speed to 1, 2 or 5 times a power of ten; a speed near real time becomes real time."""
    if has_seconds and 0.4 <= speed <= 2.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(speed))
    return min((factor * power for factor in (1, 2, 5, 10)), key=lambda each: abs(math.log(each / speed)))


def _how_fast(speed: float, unit: str) -> str:
    """Return a note on the speed of the animation."""
    if not unit:
        return f"({speed:g} in a second)"
    if speed == 1.0:
        return "(real time)"
    return f"({speed:g} times as fast)" if speed > 1 else f"(slowed down {1 / speed:g} times)"


def _short(t: float, span: float) -> str:
    """Return a time as text, with as many decimals as the length of the run requires."""
    return f"{t:.{max(0, 2 - math.floor(math.log10(span)))}f}"
