"""Examples for the pictures of the atlas: a typical failure in a test case, next to a correct run."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybridsim.errors import HybridsimError
from hybridsim.integrators.registry import registered
from hybridsim.model.checks.units import time_unit
from hybridsim.testing import measuring
from hybridsim.testing.atlas.cell import SECONDS, STEPS, Cell
from hybridsim.testing.atlas.configurations import RIVALS, Configuration
from hybridsim.testing.atlas.matrix import Atlas
from hybridsim.testing.clock import Endless, bounded_work
from hybridsim.testing.scene import END, Scene
from hybridsim.testing.verdict import HANG, RIGHT, WRONG

# Methods to show, in order of preference: common methods with visible failures.
TYPICAL = (
    "scipy-rk45 native", "scipy-dop853 native", "rk4-dichotomy", "scipy-rk45 cooldown", "rk4 tanh", "rk4-sign",
    "cvode-adams", "scipy-radau native", "scipy-lsoda native", "rk4 karnopp", "moreau",
)  # fmt: skip
TRUSTED = ("exact", "taylor", "dop853", "rodas5p", "cvode-bdf")
WIDTH = 8.0  # width of a picture in units of time
POINTS = 1500
CROWD, SOME = 100, 20  # with more than CROWD events, a picture shows only SOME of them


@dataclass(frozen=True)
class Line:
    """A run in a picture: times (k,), one state (k,), and the times of its events."""

    name: str
    t: np.ndarray
    x: np.ndarray
    events: np.ndarray


@dataclass(frozen=True)
class Example:
    """A correct and a failing run in a time window.

    Parameters
    ----------
    state, unit : name and unit of the displayed state.
    time : the unit of time, or an empty string.
    points : true values in the window.
    failing : the failing run, or None if no method fails.
    stopped : whether the failing run ended inside the window.
    """

    state: str
    unit: str
    right: Line
    failing: Line | None
    points: tuple[tuple[float, float], ...]
    stopped: bool = False
    time: str = ""


def example(result: Atlas, scene: Scene) -> Example | None:
    """Return a wrong and a correct run of a test case to draw, or None if there are no such two runs."""
    by_name = {one.name: one for one in result.configurations}
    trusted = [
        by_name[name]
        for name in TRUSTED
        if name in by_name and result.cells[scene.name, name].verdict == RIGHT
    ]
    if not trusted:
        return None
    right = solution(scene, trusted[0], result.cells[scene.name, trusted[0].name].rows[-1].setting)
    if right is None or not right.names or right.t_end == right.t_start:
        return None
    cell = typical_failure(result.row(scene))
    failing = None
    if cell is not None:
        failing = solution(scene, by_name[cell.configuration], first_wrong(cell))
    return _compared(scene, right, failing, cell)


def typical_failure(cells: list[Cell]) -> Cell | None:
    """Return the failure to show for a test case; a wrong result is preferred to a run that was aborted."""
    for verdicts in (WRONG, (HANG,)):
        found = [cell for cell in cells if cell.verdict in verdicts]
        found.sort(
            key=lambda cell: TYPICAL.index(cell.configuration) if cell.configuration in TYPICAL else 99
        )
        if found:
            return found[0]
    return None


def first_wrong(cell: Cell) -> str:
    """Return the setting that decided the verdict on a cell."""
    text = cell.reason.partition(": ")[0]
    return text if text else cell.rows[0].setting


def solution(scene: Scene, configuration: Configuration, setting: str) -> Any:
    """Return the solution of one run of a study, or None if the run has no solution."""
    options = next((s.options for s in configuration.settings(scene) if s.text == setting), None)
    if options is None:
        options = configuration.settings(scene)[-1].options
    try:
        rival = RIVALS.get(configuration.integrator, configuration.integrator)
        settings = {"form": configuration.form, **options, **configuration.options}
        with warnings.catch_warnings(), registered(rival) as name:
            warnings.simplefilter("ignore")  # warnings of naive methods are expected
            measuring.prepare(scene, name, **settings)
            with bounded_work(2 * SECONDS):
                return measuring.run(
                    scene, name, processor_seconds=SECONDS, limits={"steps": STEPS}, **settings
                )
    except (HybridsimError, Endless, ArithmeticError, ValueError):
        return None


def _compared(scene: Scene, right: Any, failing: Any, cell: Cell | None) -> Example:
    first, last = sorted((right.t_start, right.t_end))
    if failing is not None and (not failing.t.size or failing.t_end == failing.t_start):
        failing = None
    shared = last if failing is None else min(last, max(failing.t_start, failing.t_end))
    start = first if failing is None else max(first, min(failing.t_start, failing.t_end))
    row, centre = 0, first
    if failing is not None:
        t = np.linspace(start, shared, POINTS)
        a, b = np.atleast_2d(right(t)), np.atleast_2d(failing(t))[: len(right.names)]
        off = np.abs(a - b) / (np.ptp(a, axis=1, keepdims=True) + 1e-300)
        off[~np.isfinite(off)] = 0.0
        row = int(off.max(axis=1).argmax()) if off.max() > 1e-6 else 0
        # the first visible difference from the true motion
        seen = off[row] > 0.3 * min(off[row].max(), 1.0)
        centre = float(t[seen.argmax()]) if seen.any() and off.max() > 0 else first
    window = _window(first, last, centre, min(WIDTH * scene.unit, last - first))
    inside = _events(right, window)
    if len(inside) > CROWD:  # shorten the window so that single events are visible
        window = _window(first, last, centre, (window[1] - window[0]) * SOME / len(inside))
    state = right.model.states[row]
    points = tuple(
        (at, float(values[row] or 0.0))
        for t, values in scene.truth.states
        if values[row] is not None and window[0] <= (at := right.t_end if t == END else t) <= window[1]
    )
    ends = None if failing is None else max(failing.t_start, failing.t_end)
    return Example(
        state.name,
        state.unit,
        _line("right", right, row, window),
        None if failing is None or cell is None else _line(cell.configuration, failing, row, window),
        points,
        ends is not None and ends < window[1] - 1e-9 * (window[1] - window[0]),
        time_unit(right.model),
    )


def _window(first: float, last: float, centre: float, width: float) -> tuple[float, float]:
    """Return a time window of the given width around the given centre, inside the run."""
    low = min(max(first, centre - 0.4 * width), last - width)
    return low, low + width


def _events(run: Any, window: tuple[float, float]) -> np.ndarray:
    """Return the times of the events in a time window; near-grazings do not count."""
    return np.array([e.t for e in run.events if e.kind != "near-grazing" and window[0] <= e.t <= window[1]])


def _line(name: str, run: Any, row: int, window: tuple[float, float]) -> Line:
    first, last = sorted((run.t_start, run.t_end))
    t = np.linspace(max(first, window[0]), min(last, window[1]), POINTS)
    return Line(name, t, np.atleast_2d(run(t))[row], _events(run, window))
