"""This module chooses the colours of modes for pictures and notebooks."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from hybridsim.model.parts.component import Component

# The palette of Okabe and Ito, distinguishable with every kind of colour vision, without its pale yellow.
INK = "#222222"
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F4F24")

# Modes that have one colour in every picture.
_RESERVED = {
    "stick": INK, "rest": INK, "slip+": PALETTE[0], "slip-": PALETTE[1], "open": PALETTE[2], "closed": PALETTE[6],
}  # fmt: skip


def mode_colours(components: Collection[Component]) -> dict[str, str]:
    """Return a colour for each mode; modes that hold a surface are black, and known names have fixed colours."""
    held = {component.surface.hold for component in components if component.surface}
    return colours_of(dict.fromkeys(mode.name for component in components for mode in component.modes), held)


def colours_of(names: Iterable[str], held: Collection[str]) -> dict[str, str]:
    """Return a colour for each name of a mode; `held` are the names of modes that hold a surface."""
    names = list(names)
    colours = {name: _RESERVED.get(name, INK) for name in names if name in _RESERVED or name in held}
    free = [colour for colour in PALETTE if colour not in colours.values()] or PALETTE
    others = [name for name in names if name not in colours]
    colours |= {name: free[i % len(free)] for i, name in enumerate(others)}
    return {name: colours[name] for name in names}
