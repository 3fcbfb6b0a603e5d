"""This module draws maps over F0/N and r: stick, stops, errors of simpler models, and required settings."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, LogNorm
from matplotlib.figure import Figure

from hybridsim.plot.shared import style
from hybridsim.studies.he2026.measured.required_settings import EPS, STEPS, RequiredSettings
from hybridsim.studies.he2026.measured.timed_map import TimedMap
from hybridsim.studies.he2026.measured.truth import MODELS, Truth
from hybridsim.studies.he2026.pictures.deviations import edges
from hybridsim.studies.he2026.pictures.motions import column_title, plain_log

_COLOURS = "cividis"
_MOST_STOPS = 8  # larger numbers are drawn as this one


def stick_and_stops(truth: Truth) -> Figure:
    """Draw stick fraction, stops per period and amplitude of the exact motion, and the no-stop boundary."""
    figure = style.figure(style.BROAD, 4.4)
    style.put_title(figure, "The exact steady motion. White line: no stops above it (closed form)", size=10)
    panels = figure.subplots(1, 3, sharey=True)
    x, y = edges(truth.r), edges(truth.ratios)
    stick = panels[0].pcolormesh(
        x, y, 100.0 * truth.stick, cmap=_COLOURS, vmin=0.0, vmax=100.0, rasterized=True
    )
    bounds = np.arange(-0.5, _MOST_STOPS + 1.5, 1.0)
    norm = BoundaryNorm(bounds.tolist(), 256)
    stops = panels[1].pcolormesh(
        x, y, np.minimum(truth.stops, _MOST_STOPS), cmap=_COLOURS, norm=norm, rasterized=True
    )
    size = 1e6 * np.where(truth.amplitude > 0.0, truth.amplitude, np.nan)
    amplitude = panels[2].pcolormesh(
        x,
        y,
        size,
        cmap=_COLOURS,
        norm=LogNorm(float(np.nanmin(size)), float(np.nanmax(size))),
        rasterized=True,
    )
    figure.colorbar(stick, ax=panels[0], location="bottom", label="share of the period in stick [%]")
    bar = figure.colorbar(stops, ax=panels[1], location="bottom", label="stops per period")
    bar.set_ticks(range(_MOST_STOPS + 1), labels=[*map(str, range(_MOST_STOPS)), f"{_MOST_STOPS}+"])
    bar.ax.minorticks_off()
    figure.colorbar(amplitude, ax=panels[2], location="bottom", label="amplitude A [µm], N = 40 N")
    for axes, title in zip(panels, ("stick", "stops", "amplitude"), strict=True):
        _frame(axes, truth, title)
    panels[0].set_ylabel("F0/N", fontsize=9)
    return figure


def simpler_models(truth: Truth) -> Figure:
    """Draw the error of the amplitude of each simpler model."""
    figure = style.figure(style.BROAD, 3.8)
    style.put_title(
        figure,
        "Deviation of the amplitude of simpler models from the exact one. White line: no stops above it.\n"
        "Grey: the body does not move, or the model has no answer.",
        size=10,
    )
    panels = figure.subplots(1, len(MODELS), sharey=True)
    mesh: Any = None
    for axes, model in zip(panels, MODELS, strict=True):
        mesh = _deviation(axes, truth.r, truth.ratios, truth.deviation(model))
        _frame(axes, truth, model)
    panels[0].set_ylabel("F0/N", fontsize=9)
    bar = figure.colorbar(mesh, ax=panels, label="deviation of A [%]", extend="both")
    _percents(bar)
    return figure


def required_settings_map(required: RequiredSettings) -> Figure:
    """Draw the coarsest step and the largest velocity interval with which the error of A is below 1 %."""
    figure = style.figure(style.BROAD, 7.0)
    style.put_title(
        figure,
        "The coarsest setting that is within 1 % of the exact amplitude; hatched: the finest is not",
        size=10,
    )
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    rows = (
        (required.steps, STEPS, "steps per period h0, finest at the top"),
        (required.eps, EPS, "eps_v [m/s], finest at the top"),
    )
    for line, (tables, ladder, label) in zip(panels, rows, strict=True):
        mesh: Any = None
        for axes, (name, table) in zip(line, tables.items(), strict=True):
            mesh = _ladder(axes, required, table, ladder)
            axes.set_title(column_title(name), fontsize=10, loc="left")
        bar = figure.colorbar(mesh, ax=line, label=label)
        ticks = range(len(ladder)) if len(ladder) < 10 else range(0, len(ladder), 2)
        bar.set_ticks(list(ticks), labels=[_short(ladder[k]) for k in ticks])
        bar.ax.minorticks_off()
        line[0].set_ylabel("F0/N", fontsize=9)
    for axes in panels[-1]:
        axes.set_xlabel("frequency ratio r", fontsize=9)
    return figure


def timed_map(timing: TimedMap) -> Figure:
    """Draw the amplitude error over the time per point: median and largest error of the sample."""
    figure = style.figure(7.6, 4.2)
    style.put_title(
        figure,
        f"Steady amplitude over a map of {timing.side} x {timing.side} points: error (median to largest) against time",
        size=10,
    )
    axes = figure.subplots()
    for k, (name, entry) in enumerate(timing.entries.items()):
        colour = style.INK if name == "exact" else style.PALETTE[k]
        low, high = (max(float(f(entry.A)), 1e-16) for f in (np.median, np.max))
        ms = 1e3 * entry.seconds
        title = name.split(", ")
        label = f"rk4-dichotomy, {title[1]}" if len(title) > 2 else name
        axes.plot([ms, ms], [low, high], color=colour, linewidth=1.2)
        axes.plot([ms], [low], style.MARKERS[k], color=colour, markersize=7, label=label)
        axes.plot([ms], [high], "_", color=colour, markersize=10)
    plain_log(axes.xaxis)
    axes.set_yscale("log")
    axes.set_xlabel("time of a point, all threads together [ms]", fontsize=9)
    axes.set_ylabel("relative error of A", fontsize=9)
    style.dress(axes)
    style.legend_below(figure, axes.get_legend_handles_labels()[0])
    return figure


def _frame(axes: Axes, truth: Truth, title: str) -> None:
    r, ratio = truth.boundary
    low, high = edges(truth.ratios)[[0, -1]]
    axes.plot(r, np.where(ratio <= 2.0 * high, ratio, np.nan), color="white", linewidth=1.3)
    axes.set_ylim(low, high)
    axes.set_xlim(*edges(truth.r)[[0, -1]])
    axes.set_title(title, fontsize=10, loc="left")
    axes.set_xlabel("frequency ratio r", fontsize=9)
    axes.tick_params(labelsize=9)


def _deviation(axes: Axes, r: np.ndarray, ratios: np.ndarray, values: np.ndarray) -> Any:
    axes.set_facecolor(style.MARK)  # nothing moves, or the model has no answer
    shown = np.clip(100.0 * values, 0.01, 1000.0)
    return axes.pcolormesh(
        edges(r), edges(ratios), shown, norm=LogNorm(0.01, 1000.0), cmap=_COLOURS, rasterized=True
    )


def _percents(bar: Any) -> None:
    ticks = [0.01, 0.1, 1, 10, 100, 1000]
    bar.set_ticks(ticks, labels=[f"{t:g}" for t in ticks])
    bar.ax.minorticks_off()


def _ladder(axes: Axes, required: RequiredSettings, table: np.ndarray, ladder: tuple[float, ...]) -> Any:
    steps = np.argmin(np.abs(np.log(np.nan_to_num(table, nan=1.0)[..., None] / np.array(ladder))), axis=-1)
    levels = np.where(np.isnan(table), np.nan, steps)
    norm = BoundaryNorm(np.arange(-0.5, len(ladder), 1.0).tolist(), 256)
    axes.set_facecolor("white")
    x, y = edges(required.r), edges(required.ratios)
    mesh = axes.pcolormesh(x, y, levels, cmap=_COLOURS, norm=norm, rasterized=True)
    axes.patch.set(hatch="///", edgecolor=style.GREY)
    return mesh


def _short(value: float) -> str:
    return f"{value:g}" if value >= 1.0 else f"{value:.1e}"
