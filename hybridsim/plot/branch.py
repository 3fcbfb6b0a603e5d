"""This module draws a branch of periodic orbits: a measure over the parameter, with stability and special points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from hybridsim.model.checks.units import label_of, units_of
from hybridsim.plot.shared import style
from hybridsim.plot.shared.scale import label_axis

if TYPE_CHECKING:
    from hybridsim.analysis import Branch

_MARKERS = {"fold": "o", "branch point": "P", "period doubling": "s", "torus": "D", "sequence": "|"}
_TITLES = {"sequence": "sequence of modes changes"}


def branch(result: Branch, name: str | None = None, *, axes: Axes | None = None) -> Axes:
    """Draw the amplitude of a quantity (by default, of the first state) over the parameter.

    Parameters
    ----------
    axes : the axes to draw in; by default a new figure.
    """
    model = result.points[0].motion.model
    name = model.states[0].name if name is None else name
    if axes is None:
        axes = style.figure(6.4, 4.2).subplots()
    across, up, stable = result.parameter, result.amplitude(name), result.stable
    for attracts, line, label in ((True, "-", "attracts"), (False, "--", "repels")):
        drawn = _beside(stable == attracts)
        if drawn.any():
            axes.plot(
                np.where(drawn, across, np.nan), np.where(drawn, up, np.nan), line,
                color=style.PALETTE[0], linewidth=1.4, label=label,
            )  # fmt: skip
    for kind, marker in _MARKERS.items():
        chosen = [s for s in result.special if s.kind == kind]
        if chosen:
            heights = [0.5 * (up[s.index] + up[s.index + 1]) for s in chosen]
            axes.plot(
                [s.parameter for s in chosen], heights, marker, color=style.INK, markersize=6,
                markerfacecolor="white", label=_TITLES.get(kind, kind),
            )  # fmt: skip
    unit = next(label_of(p.unit) for p in model.parameters if p.name == result.name)
    label_axis(axes.xaxis, result.name, unit, across.min(), across.max())
    label_axis(axes.yaxis, f"amplitude of {name}", units_of(model).get(name, ""), up.min(), up.max())
    style.dress(axes)
    style.head(axes, model.title or model.name, f"{len(result.points)} periodic orbits")
    axes.legend(fontsize=8, frameon=False)
    return axes


def _beside(mask: np.ndarray) -> np.ndarray:
    """Return a mask extended by neighbouring points, so that the parts of a line join."""
    wider = mask.copy()
    wider[1:] |= mask[:-1]
    return wider
