"""This module sets colours and styles on each axes, without changing matplotlib's global settings."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from numpy.typing import NDArray

from hybridsim.errors import UsageError
from hybridsim.files import whole_file
from hybridsim.presentation.colours import INK as INK
from hybridsim.presentation.colours import PALETTE as PALETTE
from hybridsim.presentation.colours import colours_of as colours_of
from hybridsim.presentation.colours import mode_colours as mode_colours

GREY = "#9a9a9a"  # of frames and ticks; too pale for text
TEXT_GREY = "#666666"  # of text beside the data: its contrast with white is 5.7
MARK = "#c4c4c4"
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p")
SUFFIXES = (".png", ".pdf", ".svg")
WIDTH = 7.3  # inches of a wide picture: 700 pixels of a page, which shows it unshrunk
BROAD = 8.8  # inches of a picture with many panels: 845 pixels, the width of the text of a page
_DPI = 150
_PAD, _ROW = 6.0, 13.0  # points: above axes, and of a row of a legend
_HANDLE, _LONG_HANDLE = 4, 8  # letters: the width of a legend's handle
_LETTERS = 13.0  # of a title per inch: the default font at 10 points has about 14, fewer if they are wide
# Text of an SVG remains text, and equal pictures are equal files.
_SVG = {"svg.fonttype": "none", "svg.hashsalt": "hybridsim"}


def dress(axes: Axes) -> None:
    """Style the frame and the grid of axes so that they stay behind the data."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(GREY)
    axes.tick_params(color=GREY, labelsize=9)
    axes.grid(True, color="#e6e6e6", linewidth=0.6)
    axes.set_axisbelow(True)


def literal(text: str) -> str:
    """Return text in which dollar signs are escaped, so that matplotlib does not treat the text as mathematics."""
    return text.replace("$", r"\$")


def head(axes: Axes, *parts: str, above: float = 0.0) -> None:
    """Set the title of axes: each part begins a new line and is wrapped at the width of the axes.

    `above` is the height in points of a legend between the axes and the title.
    """
    whole, left = figure_of(axes), axes.get_position().x0
    beside = [other.get_position().x0 for other in whole.axes]
    right = min((x0 for x0 in beside if x0 > axes.get_position().x1), default=1.0)
    width = max(20, round(whole.get_figwidth() * (right - left) * _LETTERS))
    lines = [line for part in parts for line in textwrap.wrap(part, width)]
    axes.set_title(literal("\n".join(lines)), fontsize=10, loc="left", pad=_PAD + above)


def point_along(
    axes: Axes, x: NDArray[np.float64], y: NDArray[np.float64], colour: str, share: float = 0.5
) -> None:
    """Draw an arrow head along a curve, at a share of its length, in the direction of the curve."""
    wide, high = (float(np.ptp(limits)) or 1.0 for limits in (axes.get_xlim(), axes.get_ylim()))
    lengths = np.hypot(np.diff(x) / wide, np.diff(y) / high)
    if lengths.size == 0 or not lengths.sum() > 0:
        return
    k = int(np.searchsorted(np.cumsum(lengths), share * lengths.sum()))
    while k + 1 < len(lengths) and lengths[k] == 0:
        k += 1
    axes.annotate(
        "", (x[k + 1], y[k + 1]), (x[k], y[k]),
        arrowprops={"arrowstyle": "-|>", "color": colour, "mutation_scale": 13, "shrinkA": 0, "shrinkB": 0},
    )  # fmt: skip


def legend_above(axes: Axes, handles: Sequence[Artist]) -> float:
    """Name curves or colours above axes, in as many rows as their width requires; return the height in points."""
    widths = [_letters(handle) + _HANDLE for handle in handles] or [1]
    width = figure_of(axes).get_figwidth() * axes.get_position().width * _LETTERS
    columns = len(widths) if sum(widths) <= width else max(1, int(width / max(widths)))
    axes.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=columns,
        borderaxespad=0.1,
        frameon=False,
        fontsize=9,
        handlelength=1.2,
        columnspacing=1.2,
    )
    return _PAD + _ROW * math.ceil(len(handles) / columns)


def figure(width: float, height: float) -> Figure:
    """Return a new figure of the given size in inches, without a window or global state."""
    return Figure(figsize=(width, height), layout="constrained")


def wrapped(*parts: str) -> str:
    """Return the title of a whole picture of the usual width, in which each part begins a new line."""
    return literal("\n".join(line for part in parts for line in textwrap.wrap(part, round(WIDTH * _LETTERS))))


def legend_below(whole: Figure, handles: Sequence[Artist]) -> float:
    """Name lines below all panels of a figure, in as many columns as its width allows; return the height in inches."""
    longest = max(map(_letters, handles), default=1) + _LONG_HANDLE
    columns = max(1, min(len(handles), int(whole.get_figwidth() * _LETTERS / longest)))
    whole.legend(
        handles=handles, loc="outside lower center", ncols=columns, frameon=False, fontsize=9, handlelength=3
    )
    return _ROW * math.ceil(len(handles) / columns) / 72


def _letters(handle: Artist) -> int:
    """Return the number of letters of a label as drawn, without the signs of mathematical text."""
    return len(re.sub(r"\\mathregular|[${}_^]", "", str(handle.get_label())))


def put_title(whole: Figure, text: str, size: float = 11) -> None:
    """Write a text above the panels of a figure, at the left."""
    whole.suptitle(text, fontsize=size, x=0.01, ha="left")


def save(picture: Any, path: str | Path, dpi: float = _DPI) -> Path:
    """Write a picture to a file of type .png, .pdf or .svg.

    Parameters
    ----------
    picture : a figure, axes, or several axes of one figure, as the functions of `hybridsim.plot` return them.
    path : ends in .png, .pdf or .svg.
    dpi : dots per inch of a .png.
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(
            f"{path}: unsupported file type {path.suffix!r}", remedy=f"use {', '.join(SUFFIXES)}"
        )
    kind, drawn = (
        path.suffix[1:].lower(),
        BytesIO(),
    )  # in memory: some formats hide why a file cannot be written
    metadata: Any = {"Date": None, "Creator": None} if kind == "svg" else None
    with rc_context(_SVG):
        figure_of(picture).savefig(drawn, dpi=dpi, format=kind, metadata=metadata)
    text = _short_numbers(drawn.getvalue()) if kind == "svg" else drawn.getvalue()
    with whole_file(path) as partly:
        Path(partly).write_bytes(text)
    return path


def as_png(picture: Any) -> bytes:
    """Return a picture as the bytes of a PNG file, for notebooks."""
    drawn = BytesIO()
    figure_of(picture).savefig(drawn, dpi=_DPI, format="png")
    return drawn.getvalue()


def _short_numbers(svg: bytes) -> bytes:
    """Return an SVG whose coordinates have two decimals, a hundredth of a point."""
    return re.sub(rb' (?:d|x|y)="[^"]*"', lambda found: re.sub(rb"(\d\.\d\d)\d+", rb"\1", found[0]), svg)


def as_svg(picture: Any) -> str:
    """Return a picture as an SVG element for a page of HTML; letters remain text instead of outlines."""
    drawn = BytesIO()
    with rc_context(_SVG):
        figure_of(picture).savefig(
            drawn, format="svg", transparent=True, metadata={"Date": None, "Creator": None}
        )
    text = drawn.getvalue().decode("utf-8")
    return text[text.index("<svg") :]


def figure_of(picture: Any) -> Figure:
    """Return the figure that contains axes, or several axes."""
    if isinstance(picture, Figure | SubFigure):
        return picture.figure if isinstance(picture, SubFigure) else picture
    if hasattr(picture, "get_figure"):
        return picture.get_figure(root=True)
    if isinstance(picture, Iterable):
        for part in picture:
            if part is not None:
                return figure_of(part)
    raise UsageError(f"{type(picture).__name__} is not a picture", remedy="use a figure or axes")
