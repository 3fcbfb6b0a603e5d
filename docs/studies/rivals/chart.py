"""Error against time, a small chart for each scene, every marker with its name beside it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.lines import Line2D
from matplotlib.ticker import EngFormatter, LogLocator, NullFormatter

from hybridsim.plot.shared import style
from rivals.race import Line
from rivals.scenes import Scene

_LOOKS = {
    "ours": (style.PALETTE[0], "o", "hybridsim"),
    "rival": (style.PALETTE[1], "s", "other libraries"),
    "published": (style.PALETTE[2], "^", "RK4 with dichotomy, and tanh"),
    "limit": (style.INK, "D", "closed form by hand"),
}
_FLOOR = 1e-17
_ROOM = 30.0  # above the errors of a panel with undefined errors
# where a name may stand beside its marker, in points: (x, y, horizontal, vertical)
_PLACES = [
    (dx, dy, "left" if dx > 0 else "right" if dx < 0 else "center", "center")
    for lift in range(0, 31, 6)
    for dx, dy in ((6, lift), (-6, lift), (6, -lift), (-6, -lift), (0, 9 + lift), (0, -9 - lift))
]


def charts(
    scenes: Mapping[str, Scene], found: Mapping[str, Sequence[Line]], folder: Path
) -> tuple[Path, Path]:
    """Events alone against the error of their times, and with the grid against that of the states."""
    return (
        _picture(
            scenes,
            found,
            folder / "speed-events.png",
            "time, events alone",
            "error of event times / T",
            "hollow, at the top: wrong sequence of events",
            lambda line: (line.events.middle, line.errors.times) if line.events else None,
        ),
        _picture(
            scenes,
            found,
            folder / "speed-grid.png",
            "time, with 2000 states",
            "error of states / amplitude",
            "hollow: wrong sequence of events",
            lambda line: (line.grid.middle, line.errors.states),
        ),
    )


def _picture(
    scenes: Mapping[str, Scene],
    found: Mapping[str, Sequence[Line]],
    path: Path,
    across: str,
    up: str,
    wrong: str,
    point: Callable[[Line], tuple[float, float] | None],
) -> Path:
    columns = min(len(found), 2)
    rows = math.ceil(len(found) / columns)
    figure = style.figure(min(5.75 * columns, style.BROAD), 3.2 * rows + 0.5)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    drawn: list[tuple[Any, list[tuple[float, float, str, str]]]] = []
    for panel, (name, lines) in zip(panels, found.items()):
        points, beyond = [], []
        for line in lines:
            place = point(line) if line.method.shown else None
            if place is None or (line.errors.right is not False and not math.isfinite(place[1])):
                continue
            colour, marker, _ = _LOOKS[line.method.family]
            face = "white" if line.errors.right is False else colour
            looks = {"color": colour, "markersize": 5.5, "markerfacecolor": face, "zorder": 3}
            if not math.isfinite(place[1]):
                beyond.append((place[0], marker, looks, line.method.label))
                continue
            x, y = place[0], max(place[1], _FLOOR)
            panel.plot(x, y, marker, **looks)
            points.append((x, y, line.method.label, colour))
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.margins(x=0.16, y=0.12)
        for numbers, bounds in (
            ([p[0] for p in points], panel.set_xlim),
            ([p[1] for p in points], panel.set_ylim),
        ):
            if numbers and max(numbers) < 12.0 * min(numbers):  # two numbers at least stand along the axis
                low, high = math.log10(0.8 * min(numbers)), math.log10(1.25 * max(numbers))
                bounds(10.0 ** math.floor(low), 10.0 ** math.ceil(high))
        if beyond:
            _at_the_top(panel, _ROOM * max((y for _, y, _, _ in points), default=1.0), beyond)
        style.dress(panel)
        panel.set_title(scenes[name].title, fontsize=10, loc="left")
        panel.xaxis.set_major_formatter(EngFormatter(unit="s", sep="\N{THIN SPACE}"))
        panel.xaxis.set_minor_formatter(NullFormatter())
        panel.yaxis.set_major_locator(LogLocator(numticks=7))
        panel.yaxis.set_minor_formatter(NullFormatter())
        panel.set_xlabel(across, fontsize=9)
        panel.set_ylabel(up, fontsize=9)
        drawn.append((panel, points))
    for panel in panels[len(found) :]:
        panel.set_visible(False)
    families = {line.method.family for lines in found.values() for line in lines if line.method.shown}
    handles = [
        Line2D([], [], color=colour, marker=marker, linewidth=0, label=label)
        for family, (colour, marker, label) in _LOOKS.items()
        if family in families
    ]
    hollow = Line2D(
        [],
        [],
        color=style.INK,
        marker="o",
        markerfacecolor="white",
        linewidth=0,
        label=wrong,
    )
    figure.legend(
        handles=[*handles, hollow] if wrong else handles,
        loc="outside upper left",
        ncols=3 if columns > 1 else 2,
        frameon=False,
        fontsize=9,
    )
    FigureCanvasAgg(figure).draw()
    for panel, points in drawn:
        _name(panel, points)
    return style.save(figure, path)


def _at_the_top(panel: Any, top: float, beyond: list[tuple[float, str, dict[str, Any], str]]) -> None:
    """Marks of undefined errors at the top edge of a panel, and their names as a list, because they are close."""
    panel.set_ylim(top=top)
    beyond = sorted(beyond, key=lambda mark: mark[0])
    for x, marker, looks, _ in beyond:
        panel.plot(x, top, marker, **looks, clip_on=False)
    names = "\n".join(["at the top, from the left:", *(label for *_, label in beyond)])
    panel.text(0.99, 0.95, names, transform=panel.transAxes, ha="right", va="top", fontsize=8)


def _name(panel: Any, points: Sequence[tuple[float, float, str, str]]) -> None:
    """Names beside their markers, where they cover neither a marker nor another name."""
    renderer = panel.figure.canvas.get_renderer()
    pixels = panel.figure.dpi / 72
    taken = []
    for x, y, _, _ in points:
        at = panel.transData.transform((x, y))
        taken.append((at[0] - 4 * pixels, at[1] - 4 * pixels, at[0] + 4 * pixels, at[1] + 4 * pixels))
    taken += [text.get_window_extent(renderer).extents for text in panel.texts]
    frame = panel.get_window_extent(renderer)
    for x, y, label, colour in sorted(points, key=lambda p: -p[1]):
        best: Any = None
        for dx, dy, ha, va in _PLACES:
            text = panel.annotate(
                label,
                (x, y),
                (dx, dy),
                textcoords="offset points",
                ha=ha,
                va=va,
                fontsize=8,
                color=colour,
            )
            box = text.get_window_extent(renderer)
            inside = frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 and box.y1 <= frame.y1
            free = all(box.x1 < b[0] or box.x0 > b[2] or box.y1 < b[1] or box.y0 > b[3] for b in taken)
            if inside and free:
                best = box
                if abs(dy) > 12:
                    panel.annotate(
                        "",
                        (x, y),
                        (dx * 0.9, dy),
                        textcoords="offset points",
                        arrowprops={"arrowstyle": "-", "color": style.MARK, "linewidth": 0.7},
                    )
                break
            text.remove()
        if best is not None:
            taken.append((best.x0, best.y0, best.x1, best.y1))
        else:
            panel.annotate(label, (x, y), (6, 0), textcoords="offset points", fontsize=8, color=colour)
