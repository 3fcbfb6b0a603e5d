"""Pictures of the study of stability."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from stability_runs import (
    MAPPED,
    PAPER_EPS,
    PAPER_STEPS,
    TANH,
    TOLERATED,
    Case,
    Method,
)

from hybridsim.plot.shared import style

Map = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # steps, zones, errors, stops in excess
LOW, HIGH = 1e-6, 1.0  # errors that colours tell apart


def theory(panel: Axes, case: Case, method: Method, steps: np.ndarray) -> None:
    """What theory says of the boundary, as lines."""
    dashed = {"color": style.PALETTE[1], "lw": 1.8, "ls": "--"}
    dotted = {"color": "white", "lw": 1.8, "ls": ":"}
    if method is TANH:
        panel.plot(steps, case.stable(steps), **dotted, label="theory: RK4 is stable above")
        return
    if method.name == "kept" and not case.belt_speed:
        panel.axhline(case.creep(), **dashed, label="theory: creep is 1 % of x")
    elif method.name == "zeroed" or not case.belt_speed:
        panel.axhline(case.early_stop(), **dashed, label="theory: error of early stops is 1 %")
    if method.law:
        return
    panel.plot(steps, case.too_fast_for_16(steps), **dotted, label="theory: above, 16 halvings suffice")
    if not case.belt_speed:
        panel.axvline(
            case.late_release(),
            color=style.PALETTE[1],
            lw=1.4,
            ls="-.",
            label="theory: error of late releases is 1 %",
        )


def maps(case: Case, found: dict[str, Map], star: tuple[float, str], path: Path) -> None:
    """A panel for each method: error over (steps per period, width of the zone), its 1 % line, theory, the paper."""
    figure = style.figure(style.BROAD, 8.2)
    panels = figure.subplots(2, 2)
    mesh, named = None, {}
    for panel, method in zip(panels.ravel(), MAPPED):
        steps, zones, errors, excess = found[method.name]
        size = np.where(np.isfinite(errors), np.clip(np.abs(errors), LOW, HIGH), HIGH)
        mesh = panel.pcolormesh(
            steps, zones, size, norm=LogNorm(LOW, HIGH), cmap="cividis", shading="nearest"
        )
        boundary(panel, steps, zones, size, "white", "black", 2.4)
        rows, columns = np.nonzero(~np.isfinite(excess) | (np.abs(excess) > (0.11 if case.belt_speed else 0)))
        panel.plot(
            steps[columns],
            zones[rows],
            "x",
            color="#b00000",
            ms=4,
            mew=1.2,
            label="wrong number of stops",
        )
        panel.plot([], [], "-", color="black", lw=2.4, label="error 1 %")
        panel.set(xscale="log", yscale="log")  # with whole cells at the edges, and whole marks in them
        theory(panel, case, method, np.geomspace(steps[0], steps[-1], 50))
        panel.plot(PAPER_STEPS, star[0], "*", color="white", mec="black", ms=15, ls="", label=star[1])
        panel.set_title(method.title, fontsize=10, loc="left")
        panel.set(xlabel="steps per period, T/h", ylabel=f"{method.letter} / largest |v| (relative)")
        panel.tick_params(labelsize=9)
        named.update({line.get_label(): line for line in panel.get_legend_handles_labels()[0]})
    legend = figure.legend(
        handles=list(named.values()), loc="outside lower center", ncols=2, fontsize=9, facecolor="#b8b8b8"
    )
    legend.get_frame().set_edgecolor("none")
    figure.colorbar(mesh, ax=panels, label="largest relative error of the amplitude of x", extend="both")
    style.save(figure, path)


def boundary(
    panel: Axes, steps: np.ndarray, zones: np.ndarray, size: np.ndarray, halo: str, colour: str, width: float
) -> None:
    """The line at which the error is what is tolerated."""
    for line, wide in ((halo, width + 1.6), (colour, width)):
        panel.contour(
            steps,
            zones,
            np.log10(size),
            [np.log10(TOLERATED)],
            colors=[line],
            linewidths=[wide],
            linestyles="-",
        )


def moves(
    groups: dict[str, list[tuple[Case, dict[str, Map]]]], methods: tuple[Method, ...], path: Path
) -> None:
    """The 1 % lines of several cases, a row for what varies, a column for each method; right is below and right."""
    figure = style.figure(style.BROAD, 7.6)
    style.put_title(
        figure, "Lines of 1 % error: right below and to the right. Star: T/1200 and 8e-4 m/s", size=10
    )
    parts = figure.subfigures(len(groups), 1)
    for part, (says, cases) in zip(parts, groups.items()):
        row = part.subplots(1, len(methods), sharex=True, sharey=True)
        for panel, method in zip(row, methods):
            for k, (case, found) in enumerate(cases):
                steps, zones, errors, _ = found[method.name]
                size = np.where(np.isfinite(errors), np.clip(np.abs(errors), LOW, HIGH), HIGH)
                colour = style.PALETTE[k]
                stick = "no stop" if not case.stops else f"{case.stops} stops"
                panel.contour(
                    steps,
                    zones,
                    np.log10(size),
                    [np.log10(TOLERATED)],
                    colors=[colour],
                    linewidths=[1.8],
                    linestyles=[("-", "--", "-.", ":")[k]],
                )
                panel.plot(
                    [], [], ("-", "--", "-.", ":")[k], color=colour, lw=1.8, label=f"{case.name}: {stick}"
                )
                panel.plot(
                    PAPER_STEPS * 1.06**k,
                    PAPER_EPS / case.fastest,
                    "*",
                    color=colour,
                    mec="black",
                    mew=0.6,
                    ms=11,
                )
            panel.set(xscale="log", yscale="log")
            panel.set_title(method.title, fontsize=10, loc="left")
            style.dress(panel)
        row[0].set(ylabel=f"{says} varied\nwidth of the zone / largest |v|")
        for panel in row:
            panel.set(xlabel="steps per period, T/h")
        # below the panels: within them every corner has a line of some case
        part.legend(
            handles=row[0].get_legend_handles_labels()[0],
            loc="outside lower center",
            ncols=2,
            fontsize=9,
            frameon=False,
        )
    style.save(figure, path)


def chatter(found: dict[str, tuple[np.ndarray, np.ndarray]], path: Path) -> None:
    """Error of rk4-sign over the step, the worst of its last fifty periods."""
    figure = style.figure(style.WIDTH, 5.4)
    panel = figure.subplots()
    for k, (name, (steps, errors)) in enumerate(found.items()):
        size = np.where(np.isfinite(errors), np.abs(errors), np.nan)
        panel.loglog(
            steps,
            size,
            style.MARKERS[k] + "-",
            color=style.INK if name == "belt" else (*style.PALETTE, style.GREY)[k],
            ms=4,
            lw=1.2,
            label=name,
        )
    panel.axhline(TOLERATED, color="black", lw=1.6, label="1 %")
    panel.axvline(PAPER_STEPS, color=style.GREY, lw=1.6, ls=":", label="T/1200")
    steps = np.array([300.0, 6000.0])
    panel.plot(steps, 40.0 / steps, "--", color=style.INK, lw=1.0, label="first order in the step")
    panel.set(xlabel="steps per period, T/h", ylabel="relative error of the amplitude")
    panel.set_title("rk4-sign: worst of 50 periods", fontsize=10, loc="left")
    style.dress(panel)
    figure.legend(
        handles=panel.get_legend_handles_labels()[0],
        loc="outside lower center",
        ncols=3,
        fontsize=9,
        frameon=False,
    )
    style.save(figure, path)
