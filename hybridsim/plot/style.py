"""Colours and dress of the pictures, set on each axes; matplotlib's global settings are left alone."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure, SubFigure

from hybridsim.errors import UsageError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from hybridsim.model import Model

# Okabe and Ito's palette, told apart with every kind of colour vision; yellow, too pale for a line, is out.
INK = "#222222"
FAINT = "#9a9a9a"
MARK = "#c4c4c4"
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F4F24")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p")
SUFFIXES = (".png", ".pdf", ".svg")
_DPI = 150


def mode_colours(model: Model) -> dict[str, str]:
    """A colour for each mode by name: ink where a surface holds (stick), the palette in order for others."""
    components = model.all_components()
    held = {component.surface.hold for component in components if component.surface}
    names = dict.fromkeys(mode.name for component in components for mode in component.modes)
    free = [name for name in names if name not in held]
    colours = {name: PALETTE[i % len(PALETTE)] for i, name in enumerate(free)}
    return {name: INK if name in held else colours[name] for name in names}


def dress(axes: Axes) -> None:
    """Quiet frame and grid, behind the data."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(FAINT)
    axes.tick_params(color=FAINT, labelsize=9)
    axes.grid(True, color="#e6e6e6", linewidth=0.6)
    axes.set_axisbelow(True)


def literal(text: str) -> str:
    """Text from a model as it stands: matplotlib would read what is between dollars as mathematics."""
    return text.replace("$", r"\$")


def figure(width: float, height: float) -> Figure:
    """A figure (inches) that belongs to no window and to no global state."""
    return Figure(figsize=(width, height), layout="constrained")


def save(picture: Any, path: str | Path) -> Path:
    """Write a picture to a file.

    Parameters
    ----------
    picture : a figure, axes, or several axes of one figure, as the functions of `hybridsim.plot` return them.
    path : ends in .png, .pdf or .svg.
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(
            f"{path} is no picture that can be written", remedy=f"end it in {', '.join(SUFFIXES)}"
        )
    _figure_of(picture).savefig(path, dpi=_DPI)
    return path


def _figure_of(picture: Any) -> Figure:
    if isinstance(picture, Figure | SubFigure):
        return picture.figure if isinstance(picture, SubFigure) else picture
    if hasattr(picture, "get_figure"):
        return picture.get_figure(root=True)
    if isinstance(picture, Iterable):
        for part in picture:
            if part is not None:
                return _figure_of(part)
    raise UsageError(f"{type(picture).__name__} is no picture", remedy="give a figure or axes")
