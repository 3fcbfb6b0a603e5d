"""This module chooses the hue, the marker and the dashes of each line in comparisons."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.colors import to_hex, to_rgb
from matplotlib.lines import Line2D

from hybridsim.plot.shared import style

if TYPE_CHECKING:
    from hybridsim.analysis.compare.rows import Row

SIZE = 6.5
PALE = 0.5

# colours of regularised forms and of the set-valued law; their integrators differ in dashes
_SET_VALUED = "set-valued"
_FORMS = {
    _SET_VALUED: style.INK,
    "tanh": style.PALETTE[0],
    "arctan": style.PALETTE[1],
    "karnopp": style.PALETTE[2],
}
# The hue of each family, from Okabe and Ito's palette. A name belongs to the first prefix that matches.
_FAMILIES: tuple[tuple[str, tuple[str, ...]], ...] = (
    (style.TEXT_GREY, ("rk4-", "moreau")),  # fixed steps
    (style.PALETTE[1], ("scipy-rk", "scipy-dop")),  # explicit methods of SciPy
    (style.PALETTE[2], ("scipy-",)),  # its other methods
    (style.PALETTE[3], ("cvode-",)),
    (style.INK, ("exact",)),
    (style.PALETTE[5], ("taylor",)),
    (style.PALETTE[4], ("rodas",)),
    (style.PALETTE[0], ("",)),  # explicit Runge-Kutta methods, and all others
)
_MARKERS = (*style.MARKERS, "h", "d", "8")
_DARKEST = 0.7  # part of a hue that its darkest shade keeps; no shade is paler than the hue


@dataclass(frozen=True)
class Look:
    """Colour, marker and dashes of a line."""

    colour: str
    marker: str
    dashes: str

    def handle(self, label: str, size: float = SIZE) -> Line2D:
        """Return the legend entry of a line with this style."""
        return Line2D(
            [], [], color=self.colour, marker=self.marker, linestyle=self.dashes, markersize=size, linewidth=1.1,
            label=label,
        )  # fmt: skip


def looks(rows: Iterable[Row]) -> dict[str, Look]:
    """Return the style of each label, in the order of the rows of the comparison.

    Methods of one family share a hue and differ in shade and marker. Several lines of one method (our
    events and its own, published and refined) or of one regularised form differ in their dashes.
    """
    rows = list(rows)
    whole = _SET_VALUED if any(row.form for row in rows) else ""
    methods: dict[str, list[str]] = {}
    names: dict[str, str] = {}
    for row in rows:
        name = row.form or whole or row.integrator
        names.setdefault(row.label, name)
        labels = methods.setdefault(name, [])
        if row.label not in labels:
            labels.append(row.label)
    families: dict[str, list[str]] = {}
    for name in methods:
        families.setdefault(_hue(name), []).append(name)
    found = {}
    for label, name in names.items():
        hue = _hue(name)
        place, size = families[hue].index(name), len(families[hue])
        marker = _MARKERS[list(methods).index(name) % len(_MARKERS)]
        dashes = ("-", "--", ":", "-.")[methods[name].index(label) % 4]
        found[label] = Look(_shade(hue, place, size), marker, dashes)
    return found


def _hue(name: str) -> str:
    return _FORMS.get(name) or next(hue for hue, prefixes in _FAMILIES if name.startswith(prefixes))


def _shade(hue: str, place: int, count: int) -> str:
    """Return one of `count` shades of a colour; the first shade is the darkest."""
    if count == 1:
        return hue
    part = _DARKEST + (1 - _DARKEST) * place / (count - 1)
    return to_hex([part * channel for channel in to_rgb(hue)])


def draw_line(
    panel: Axes, look: Look, points: Sequence[tuple[float, float]], spreads: Sequence[tuple[float, float]],
    verdicts: Sequence[bool | None], size: float = SIZE, cold: Sequence[bool] = (),
) -> None:  # fmt: skip
    """Draw the points (time, error) of a line, with the spread of the measured times.

    A point is filled if the modes are right, and half filled if there are no modes to compare. A point with
    wrong modes is hollow and at the top edge, apart from the errors, because it is another motion. A cold point
    was timed only in its first run, which warms up; it is drawn pale, without the line.
    """
    if not points:
        return
    cold = cold or [False] * len(points)
    judged = list(zip(points, verdicts, cold, strict=True))
    sound = [point for point, right, _ in judged if right is not False]
    timed = [point for point, right, is_cold in judged if right is not False and not is_cold] or sound
    if timed:
        panel.plot(
            *zip(*timed, strict=True), color=look.colour, linestyle=look.dashes, linewidth=size / 6, zorder=2
        )
    for (point, right, is_cold), (low, high) in zip(judged, spreads, strict=True):
        x, y = point if right is not False else (point[0], 1.0)
        if high > low and right is not False:
            panel.plot([low, high], [y, y], color=look.colour, linewidth=size / 6, alpha=0.5, zorder=2)
        (mark,) = panel.plot(
            x, y, look.marker, color=look.colour, markersize=size, markeredgewidth=size / 5,
            markerfacecolor="white" if right is False else look.colour, markerfacecoloralt="white",
            fillstyle="left" if right is None else "full", alpha=PALE if is_cold else 1.0,
            transform=panel.get_xaxis_transform() if right is False else panel.transData,
        )  # fmt: skip
        if right is False:
            mark.set(clip_on=False, zorder=4)
