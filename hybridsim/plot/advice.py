"""Pictures of an advice: the error of each rung beside the tolerance, or a map of the simplest adequate rung."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch

from hybridsim.errors import UsageError
from hybridsim.plot import style
from hybridsim.plot.sweep_readings import label_parameter, positions

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from hybridsim.analysis import Advice

_FLOOR = 1e-16  # errors below rounding are drawn there
_TOP = 1e2  # and infinite ones there
_NOTHING = "#d8d8d8"  # grey is no rung's colour
_COLOURS = {
    "at-rest": "#4d4d4d", "no-friction": "#a6cee3", "viscous": "#1f78b4", "no-stop": "#33a02c",
    "constant-mu-at-rest": "#fdbf6f", "constant-mu-mean": "#ff7f00", "mu_s=mu_k": "#b15928",
    "tanh": "#cab2d6", "arctan": "#6a3d9a", "karnopp": "#fb9a99", "full model": "#e31a1c",
}  # fmt: skip


def advice(found: Advice, axes: Axes | None = None) -> Axes:
    """Draw an advice: the ladder of one scene, or the map of a region of two parameters.

    In the ladder a bar is the error of a rung against the full model, the line the tolerance; a rung without a bar does
    not apply, or gives no value.
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
    steps = [step for step in found.ladder if step.name != "full model"]
    for k, step in enumerate(steps):
        if step.value is None:
            axes.text(
                0.01,
                k,
                step.verdict,
                transform=axes.get_yaxis_transform(),
                va="center",
                fontsize=8,
                color=style.FAINT,
            )
            continue
        error = min(max(step.error, _FLOOR), _TOP)
        axes.barh(
            k, error, left=0.0, height=0.6, color=_COLOURS[step.name], alpha=1.0 if step.is_adequate else 0.45
        )
    axes.set_xscale("log")
    axes.set_xlim(_FLOOR, _TOP)
    axes.axvline(found.tol, color=style.INK, linewidth=1.2)
    axes.text(
        found.tol,
        1.0,
        f" tolerance {found.tol:g}",
        transform=axes.get_xaxis_transform(),
        fontsize=8,
        va="bottom",
    )
    axes.set_yticks(range(len(steps)), [style.literal(step.name) for step in steps])
    axes.invert_yaxis()
    style.dress(axes)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel(style.literal(f"error of {found.quantity} against the full model"))
    style.head(axes, f"{found.model.title or found.model.name}: {found.simplest.title}", " ")


def _map(found: Advice, axes: Axes) -> None:
    region = found.region
    assert region is not None
    if len(region.axes) != 2 or region.mode != "grid":
        raise UsageError(
            f"a map needs two parameters, and the region has {len(region.axes)}",
            remedy="look at advice.region instead",
        )
    names = [step.name for step in found.ladder]
    numbers = np.full(region.status.shape, len(names), dtype=float)
    for k, name in enumerate(names):
        numbers[(region["simplest"] == name) & ~region.failed] = k
    places = []
    up, across = region.axes
    for dimension, parameter in enumerate((up, across)):
        where = positions(region.axes[parameter])
        order = np.argsort(where, kind="stable")
        numbers = np.take(numbers, order, axis=dimension)
        places.append(where[order])
    colours = ListedColormap([*(_COLOURS[name] for name in names), _NOTHING])
    axes.pcolormesh(
        places[1], places[0], numbers, cmap=colours, vmin=-0.5, vmax=len(names) + 0.5, shading="nearest",
        rasterized=True,
    )  # fmt: skip
    label_parameter(axes.yaxis, region, up)
    label_parameter(axes.xaxis, region, across)
    axes.tick_params(color=style.FAINT, labelsize=9)
    axes.spines[:].set_color(style.FAINT)
    shown = [
        Patch(color=_COLOURS[name], label=style.literal(name))
        for k, name in enumerate(names)
        if (numbers == k).any()
    ]
    if (numbers == len(names)).any():
        shown.append(Patch(color=_NOTHING, label="no answer"))
    axes.legend(handles=shown, fontsize=8, loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
    style.head(axes, f"Simplest model for {found.quantity} within {found.tol:g}")
