"""This module sets colours and styles on each axes, without changing matplotlib's global settings."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from io import BytesIO
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from hybridsim.errors import UsageError
from hybridsim.files import whole_file
from hybridsim.presentation.colours import INK as INK
from hybridsim.presentation.colours import PALETTE as PALETTE
from hybridsim.presentation.colours import colours_of as colours_of
from hybridsim.presentation.colours import mode_colours as mode_colours

GREY = "#9a9a9a"
MARK = "#c4c4c4"
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p")
SUFFIXES = (".png", ".pdf", ".svg")
_DPI = 150
_LETTERS = 13.0  # of a title per inch: the default font at 10 points has about 14, fewer if they are wide


def dress(axes: Axes) -> None:
    """Style the frame and the grid of axes so that they stay behind the data."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(GREY)
    axes.tick_params(color=GREY, labelsize=9)
    axes.grid(True, color="#e6e6e6", linewidth=0.6)
    axes.set_axisbelow(True)


def literal(text: str) -> str:
    """Return text in which dollar signs are escaped, so that matplotlib does not read it as mathematics."""
    return text.replace("$", r"\$")


def head(axes: Axes, *parts: str) -> None:
    """Set the title of axes: each part begins a new line and is wrapped at the width of the axes."""
    whole, left = _figure_of(axes), axes.get_position().x0
    beside = [other.get_position().x0 for other in whole.axes]
    right = min((x0 for x0 in beside if x0 > axes.get_position().x1), default=1.0)
    width = max(20, round(whole.get_figwidth() * (right - left) * _LETTERS))
    lines = [line for part in parts for line in textwrap.wrap(part, width)]
    axes.set_title(literal("\n".join(lines)), fontsize=10, loc="left")


def figure(width: float, height: float) -> Figure:
    """Return a new figure of the given size in inches, without a window or global state."""
    return Figure(figsize=(width, height), layout="constrained")


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
    drawn = BytesIO()  # drawn in memory, because some formats hide why a file cannot be written
    _figure_of(picture).savefig(drawn, dpi=dpi, format=path.suffix[1:].lower())
    with whole_file(path) as partly:
        Path(partly).write_bytes(drawn.getvalue())
    return path


def as_png(picture: Any) -> bytes:
    """Return a picture as the bytes of a PNG file, for notebooks."""
    drawn = BytesIO()
    _figure_of(picture).savefig(drawn, dpi=_DPI, format="png")
    return drawn.getvalue()


def as_svg(picture: Any) -> str:
    """Return a picture as an SVG element, with its text as text, for a page of HTML."""
    drawn = BytesIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "hybridsim"}):
        _figure_of(picture).savefig(
            drawn, format="svg", transparent=True, metadata={"Date": None, "Creator": None}
        )
    text = drawn.getvalue().decode("utf-8")
    return text[text.index("<svg") :]


def _figure_of(picture: Any) -> Figure:
    if isinstance(picture, Figure | SubFigure):
        return picture.figure if isinstance(picture, SubFigure) else picture
    if hasattr(picture, "get_figure"):
        return picture.get_figure(root=True)
    if isinstance(picture, Iterable):
        for part in picture:
            if part is not None:
                return _figure_of(part)
    raise UsageError(f"{type(picture).__name__} is not a picture", remedy="use a figure or axes")
