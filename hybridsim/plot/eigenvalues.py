"""This module draws the eigenvalues of a linearised model in the complex plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.axes import Axes

from hybridsim.plot.shared import style

if TYPE_CHECKING:
    from hybridsim.analysis import Linearization

_GROWING = "#fbeae0"  # the half plane of eigenvalues whose motions grow


def eigenvalues(result: Linearization, *, axes: Axes | None = None) -> Axes:
    """Draw the eigenvalues of a linearization in the complex plane, in rad per unit of t.

    Motions of eigenvalues right of the vertical axis grow; that half of the plane is shaded.

    Parameters
    ----------
    axes : the axes to draw in; by default a new figure.
    """
    values = result.eigenvalues
    if axes is None:
        axes = style.figure(5.6, 4.2).subplots()
    size = max(abs(values).max(initial=0.0), 1e-300)
    axes.set_xlim(-1.15 * size, 1.15 * size)
    axes.set_ylim(-1.15 * size, 1.15 * size)
    axes.axvspan(0.0, 1.15 * size, color=_GROWING, zorder=0)
    axes.axvline(0.0, color=style.GREY, linewidth=0.8)
    for grows, colour, label in ((False, style.PALETTE[0], "decays"), (True, style.PALETTE[1], "grows")):
        chosen = values[(values.real > 0.0) == grows]
        if len(chosen):
            axes.plot(chosen.real, chosen.imag, "x", color=colour, markersize=8, label=label)
    style.dress(axes)
    axes.set_xlabel("real part: growth")
    axes.set_ylabel("imaginary part: angular frequency")
    style.head(
        axes, "stable" if result.stable else "not stable", f"free states {', '.join(result.states) or 'none'}"
    )
    if len(values):
        axes.legend(fontsize=8, frameon=False)
    return axes
