"""This module draws the result of `advise`: errors of simplified models, or a map of the adequate models."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch

from hybridsim.errors import UsageError
from hybridsim.plot.shared import style
from hybridsim.plot.sweeps.readings import NO_COLOUR, draw_map

if TYPE_CHECKING:
    from hybridsim.analysis import Advice
    from hybridsim.analysis.advise.ladder import Step

# Range of the error axis: at least _NEAR and at most _FAR times the tolerance on both sides, with a margin
# factor.
_NEAR, _FAR, _MARGIN = 30.0, 1e5, 2.0
_TOP_LINE = -0.75  # above the first rung, in rungs
_BESIDE = (1.03, 1.17)  # places of the columns of error and cost, in widths of the axes
# Distinguishable with every kind of colour vision: Okabe and Ito's palette, two of Tol's colours and dark grey.
_COLOURS = {
    "at-rest": "#4d4d4d", "no-friction": "#56b4e9", "viscous": "#0072b2", "no-stop": "#009e73",
    "constant-mu-at-rest": "#f0e442", "constant-mu-mean": "#e69f00", "mu_s=mu_k": "#7f4f24",
    "tanh": "#cc79a7", "arctan": "#882255", "karnopp": "#999933", "full model": "#d55e00",
}  # fmt: skip


def advice(found: Advice, axes: Axes | None = None) -> Axes:
    """Draw the result of `advise`: the simplified models of one test case, or the map of a parameter region.

    In the ladder a stem leads from the tolerance to the error of each rung. An adequate rung has a filled
    marker on the left, and an arrow marks an error beyond the axis. The error and the cost are written next
    to it. A rung without a stem does not apply, gives no value, or was stopped.
    """
    if axes is None:
        size = (6.4, 4.2) if found.region is not None else (7.2, 0.34 * len(found.ladder) + 1.4)
        axes = style.figure(*size).add_subplot()
    if found.region is not None:
        _map(found, axes)
    else:
        _ladder(found, axes)
    return axes


def _ladder(found: Advice, axes: Axes) -> None:
    from hybridsim.analysis.advise.ladder import NOT_ADEQUATE, duration

    steps = [step for step in found.ladder if step.name != "full model"]
    low, high = _window([step.error for step in steps if step.value is not None], found.tol)
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    axes.axvspan(low, found.tol, color=style.MARK, alpha=0.3, linewidth=0.0, zorder=0)
    axes.axvline(found.tol, color=style.INK, linewidth=1.2)
    for k, step in enumerate(steps):
        if step.value is None:
            word = "no value" if step.verdict == NOT_ADEQUATE else step.verdict
            axes.text(1.1 * found.tol, k, word, va="center", fontsize=8, color=style.TEXT_GREY)
            continue
        _draw(axes, k, step, found.tol, (low, high))
        _beside(axes, k, (_short(step.error), duration(step.seconds)), style.INK)
    _beside(axes, _TOP_LINE, ("error", "cost"), style.TEXT_GREY)
    axes.text(
        found.tol / 1.1, _TOP_LINE, f"adequate: up to {found.tol:g}", ha="right", va="center", fontsize=8
    )
    axes.set_yticks(range(len(steps)), [style.literal(step.name) for step in steps])
    axes.set_ylim(len(steps) - 0.4, -1.2)
    style.dress(axes)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel(style.literal(f"error of {found.quantity}, relative to the full model's value"))
    style.head(
        axes,
        f"Simplest model of {found.model.name} for {found.quantity} within {found.tol:g}: {found.simplest.title}",
    )


def _window(errors: Iterable[float], tol: float) -> tuple[float, float]:
    """Return the ends of the error axis, between which the tolerance and all comparable errors lie."""
    near = [e for e in errors if tol / _FAR <= e <= tol * _FAR]
    return min([tol / _NEAR, *near]) / _MARGIN, max([tol * _NEAR, *near]) * _MARGIN


def _draw(axes: Axes, k: int, step: Step, tol: float, ends: tuple[float, float]) -> None:
    """Draw a line from the tolerance to the error of a model. Its end is filled if the model is adequate.

    An arrow marks an error outside the axis.
    """
    low, high = ends
    colour = style.PALETTE[0] if step.is_adequate else style.PALETTE[1]
    at = min(max(step.error, low), high)
    marker = "<" if step.error < low else ">" if step.error > high else "o"
    axes.hlines(k, tol, at, color=colour, linewidth=1.6)
    face = colour if step.is_adequate else "white"
    axes.plot([at], [k], marker, color=colour, markerfacecolor=face, markersize=7, clip_on=False, zorder=3)


def _beside(axes: Axes, y: float, cells: tuple[str, str], colour: str) -> None:
    """Write two cells to the right of the axes, at the height of one simplified model."""
    for x, text in zip(_BESIDE, cells, strict=True):
        axes.text(x, y, text, transform=axes.get_yaxis_transform(), va="center", fontsize=8, color=colour)


def _short(error: float) -> str:
    return "\u221e" if math.isinf(error) else f"{error:.1e}" if 0.0 < error < 1e-3 else f"{error:.2g}"


def _map(found: Advice, axes: Axes) -> None:
    region = found.region
    assert region is not None
    if len(region.axes) != 2 or region.mode != "grid":
        raise UsageError(
            f"a map needs two parameters, but the region has {len(region.axes)}",
            remedy="use the table advice.region instead of a map",
        )
    names = [step.name for step in found.ladder]
    numbers = np.full(region.status.shape, len(names), dtype=float)
    for k, name in enumerate(names):
        numbers[(region["simplest"] == name) & ~region.failed] = k
    colours = ListedColormap([*(_COLOURS[name] for name in names), NO_COLOUR])
    draw_map(axes, region, numbers, cmap=colours, vmin=-0.5, vmax=len(names) + 0.5)
    shown = [
        Patch(color=_COLOURS[name], label=style.literal(name))
        for k, name in enumerate(names)
        if (numbers == k).any()
    ]
    if (numbers == len(names)).any():
        shown.append(Patch(color=NO_COLOUR, label="no answer"))
    axes.legend(handles=shown, fontsize=8, loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
    style.head(axes, f"Simplest model for {found.quantity} within {found.tol:g}")
