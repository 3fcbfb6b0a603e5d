"""This module chooses the colours of modes for pictures and notebooks."""

from __future__ import annotations

from collections.abc import Collection

from hybridsim.model.parts.component import Component

# The palette of Okabe and Ito, distinguishable with every kind of colour vision, without its pale yellow.
INK = "#222222"
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F4F24")


def mode_colours(components: Collection[Component]) -> dict[str, str]:
    """Return a colour for each mode: black for modes that hold a surface, others from the palette."""
    held = {component.surface.hold for component in components if component.surface}
    names = dict.fromkeys(mode.name for component in components for mode in component.modes)
    free = [name for name in names if name not in held]
    colours = {name: PALETTE[i % len(PALETTE)] for i, name in enumerate(free)}
    return {name: INK if name in held else colours[name] for name in names}
