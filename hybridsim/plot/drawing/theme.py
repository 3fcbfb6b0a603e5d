"""This module defines the colours of a picture on a light and on a dark background."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.collections import Collection
from matplotlib.colors import to_hex, to_rgba, to_rgba_array
from matplotlib.figure import Figure

from hybridsim.plot.shared import style


@dataclass(frozen=True)
class Theme:
    """The colours of drawings: background, lines, weak lines, bodies, rims, water and forces."""

    paper: str
    ink: str
    weak: str
    body: str
    rim: str
    water: str
    force: str

    @property
    def colours(self) -> tuple[str, ...]:
        """Return all colours of the theme."""
        return self.paper, self.ink, self.weak, self.body, self.rim, self.water, self.force

    def mode(self, colour: str) -> str:
        """Return the colour of a mode on this background."""
        return self.ink if colour == style.INK else colour


LIGHT = Theme("#ffffff", style.INK, "#8a8a8a", "#d9e5ef", "#b4c7d9", "#a9d3ee", "#9b4f7c")
DARK = Theme("#14181e", "#e9edf1", "#8d959e", "#33475b", "#4d647c", "#2f6b94", "#e39bc4")

# What the light colours of the pictures become on a dark background.
_DARK = {
    style.INK: DARK.ink, "#000000": DARK.ink, style.GREY: DARK.weak, style.MARK: "#46505b", "#e6e6e6": "#29313a",
    "#ffffff": DARK.paper, "#cccccc": DARK.weak,
}  # fmt: skip


def darken(figure: Figure) -> None:
    """Change the colours of a picture of this package for a dark background."""
    for artist in [figure, *figure.findobj()]:
        for kind in ("color", "facecolor", "edgecolor", "facecolors", "edgecolors"):
            get, change = getattr(artist, f"get_{kind}", None), getattr(artist, f"set_{kind}", None)
            if get is None or change is None or (kind[-1] == "s" and not isinstance(artist, Collection)):
                continue
            changed = _changed(get())
            if changed is not None:
                change(changed)


def _changed(colour: Any) -> Any:
    """Return the dark colours that replace light colours, or None if no colour changes."""
    try:
        colours = to_rgba_array(colour)
    except (TypeError, ValueError):
        return None
    found = [
        to_rgba(_DARK[text], alpha) if (text := to_hex(one)) in _DARK and (alpha := one[3]) else tuple(one)
        for one in colours
    ]
    if not found or np.array_equal(found, colours):
        return None
    return found if len(found) > 1 or np.ndim(colour) == 2 else found[0]
