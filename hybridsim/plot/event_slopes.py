"""This module draws how the event times of a run change with parameters or initial states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from hybridsim.arguments import known_name
from hybridsim.errors import UsageError
from hybridsim.plot.shared import style

if TYPE_CHECKING:
    from hybridsim.analysis import Sensitivities

_MOST = 6  # panels by default


def event_slopes(
    result: Sensitivities, names: Sequence[str] = (), *, axes: Sequence[Axes] | None = None
) -> tuple[Axes, ...]:
    """Draw the derivatives of event times against the event times, with a panel for each parameter.

    The value at an event is dt/dp: the delay of the event per unit of the parameter or of the initial state.

    Parameters
    ----------
    names : parameters, or states for the initial values; by default the first six parameters, or states without any.
    axes : one for each name; by default a new figure.

    Raises
    ------
    UsageError
        If the run has no events, or a name is unknown.
    """
    if not len(result.times):
        raise UsageError(
            "the run has no events, so there are no event times to draw",
            remedy="print the sensitivities, which also contain the derivatives of the final state",
        )
    known = {**dict.fromkeys(result.states), **dict.fromkeys(result.parameters)}
    slopes = dict(zip(known, np.hstack([result.times_by_start, result.times_by_parameter]).T, strict=True))
    chosen = [known_name(name, list(known), "the sensitivities have no", "names") for name in names]
    chosen = chosen or list(result.parameters or result.states)[:_MOST]
    if axes is None:
        figure = style.figure(7.2, 1.6 * len(chosen) + 0.9)
        panels = tuple(figure.subplots(len(chosen), 1, sharex=True, squeeze=False)[:, 0])
    else:
        panels = tuple(axes)
    if len(panels) != len(chosen):
        raise UsageError(
            f"{len(panels)} axes were passed for {len(chosen)} names",
            remedy="pass one Matplotlib axes for each name",
        )
    for panel, name in zip(panels, chosen, strict=True):
        panel.vlines(result.times, 0.0, slopes[name], color=style.PALETTE[0], linewidth=0.9)
        panel.plot(result.times, slopes[name], "o", color=style.PALETTE[0], markersize=3)
        panel.axhline(0.0, color=style.GREY, linewidth=0.8)
        style.dress(panel)
        panel.set_ylabel(style.literal(f"dt/d{name}" if name in result.parameters else f"dt/d{name}(0)"))
    panels[-1].set_xlabel("t of the event")
    style.head(panels[0], f"how {len(result.times)} event times change")
    return panels
