"""The matrix: scenes against configurations, run on several processors, as data."""

from __future__ import annotations

import json
import math
import multiprocessing
import os
import signal
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from typing import Any

from hybridsim.errors import UsageError, nearest
from hybridsim.integrators.base import Integrator
from hybridsim.integrators.registry import registered
from hybridsim.testing.atlas.cell import SECONDS, STEPS, Cell, run_cell
from hybridsim.testing.atlas.configurations import Configuration, chosen
from hybridsim.testing.atlas.verdict import VERDICTS
from hybridsim.testing.catalogue import SCENES
from hybridsim.testing.scene import TROUBLES, Scene

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Atlas:
    """What came of every scene with every configuration.

    Parameters
    ----------
    cells : by scene and configuration name.
    """

    scenes: tuple[Scene, ...]
    configurations: tuple[Configuration, ...]
    cells: Mapping[tuple[str, str], Cell]

    def row(self, scene: Scene) -> list[Cell]:
        """The cells of a scene, in the order of the configurations."""
        return [self.cells[scene.name, one.name] for one in self.configurations]

    def column(self, configuration: Configuration) -> list[Cell]:
        """The cells of a configuration, in the order of the scenes."""
        return [self.cells[scene.name, configuration.name] for scene in self.scenes]

    def by_class(self) -> dict[str, list[Scene]]:
        """The scenes of each class of trouble, in the order of the classes."""
        found = {trouble: [s for s in self.scenes if s.trouble == trouble] for trouble in (*TROUBLES, "")}
        return {trouble: scenes for trouble, scenes in found.items() if scenes}

    def table(self) -> str:
        """How many scenes of each verdict every configuration has, as text."""
        width = max(len(one.name) for one in self.configurations)
        lines = [f"{'':{width}}  " + "  ".join(VERDICTS)]
        for one in self.configurations:
            cells = self.column(one)
            counts = [sum(cell.verdict == verdict for cell in cells) for verdict in VERDICTS]
            lines.append(
                f"{one.name:{width}}  " + "  ".join(f"{n:>{len(v)}}" for v, n in zip(VERDICTS, counts))
            )
        return "\n".join(lines)

    def to_plain(self) -> dict[str, Any]:
        """Plain data: scenes, configurations, and a cell for each pair."""
        return {
            "limits": {"seconds": SECONDS, "steps": STEPS},
            "scenes": [
                {"name": s.name, "class": s.trouble, "title": s.title, "cause": s.cause} for s in self.scenes
            ],
            "integrators": [asdict(one) for one in self.configurations],
            "cells": [cell.to_plain() for scene in self.scenes for cell in self.row(scene)],
        }

    def to_json(self) -> str:
        """The same as text, a line for each cell; numbers that JSON does not have become null."""
        plain = _finite(self.to_plain())
        parts = []
        for name, part in plain.items():
            lines = ",\n".join(json.dumps(item) for item in part) if isinstance(part, list) else ""
            parts.append(f'"{name}": ' + (f"[\n{lines}\n]" if lines else json.dumps(part)))
        return "{\n" + ",\n".join(parts) + "\n}\n"

    @classmethod
    def from_json(cls, text: str) -> Atlas:
        """What `to_json` wrote, with the scenes of the package as they are told of now."""
        plain = json.loads(text)
        scenes = {scene.name: scene for scene in SCENES}
        found = [Cell.from_plain(cell) for cell in plain["cells"]]
        return cls(
            tuple(scenes[one["name"]] for one in plain["scenes"]),
            tuple(Configuration(**one) for one in plain["integrators"]),
            {(cell.scene, cell.configuration): cell for cell in found},
        )


def atlas(
    scenes: Iterable[Scene] | None = None,
    integrators: Sequence[str | type[Integrator]] | None = None,
    *,
    quick: bool = False,
    workers: int = 1,
    progress: Progress | None = None,
) -> Atlas:
    """Run scenes with configurations and return the matrix of verdicts.

    Parameters
    ----------
    scenes : the package's own without it.
    integrators : names of integrators or configurations, or an `Integrator` class of your own; all without it.
    quick : the loosest setting of each study only, which shows gross failures.
    workers : processes, of which each starts Python anew: with more than one, scenes and integrators have to be the
        package's own or installed, and a script needs its ``if __name__ == "__main__"``.
    progress : called with the finished fraction and the name of the scene.

    Errors
    ------
    UsageError for a name that does not exist.
    """
    own = [one for one in integrators or () if not isinstance(one, str)]
    if len(own) > 1 or (own and len(integrators or ()) > 1):
        raise UsageError("a class of your own runs alone", remedy="call atlas once for each")
    if own:
        with registered(own[0]) as name:
            return atlas(scenes, (name,), quick=quick, workers=1, progress=progress)
    names = None if integrators is None else tuple(str(one) for one in integrators)
    selected, methods = tuple(SCENES if scenes is None else scenes), chosen(names)
    jobs = [(scene, one) for scene in selected for one in methods]
    cells: dict[tuple[str, str], Cell] = {}

    def keep(cell: Cell) -> None:
        cells[cell.scene, cell.configuration] = cell
        if progress is not None:
            progress(len(cells) / len(jobs), cell.scene)

    if workers > 1:
        _in_processes(jobs, quick, workers, keep)
    else:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what a naive method provokes is part of the answer
            for scene, one in jobs:
                keep(run_cell(scene, one, quick))
    return Atlas(selected, methods, cells)


def scenes_named(names: Sequence[str], trouble: str = "") -> tuple[Scene, ...]:
    """The package's scenes of these names, or of a class of trouble; all without either."""
    known = {scene.name: scene for scene in SCENES}
    if trouble and trouble not in TROUBLES:
        raise UsageError(
            f"there is no class of trouble {trouble!r}", remedy=nearest(trouble, TROUBLES, kind="classes")
        )
    for name in names:
        if name not in known:
            raise UsageError(f"there is no scene {name!r}", remedy=nearest(name, known, kind="scenes"))
    of_class = [scene for scene in SCENES if not trouble or scene.trouble == trouble]
    return tuple(known[name] for name in names) or tuple(of_class)


def _in_processes(
    jobs: Sequence[tuple[Scene, Configuration]], quick: bool, workers: int, keep: Callable[[Cell], None]
) -> None:
    pool = ProcessPoolExecutor(
        workers, mp_context=multiprocessing.get_context("spawn"), initializer=_quiet_worker
    )
    try:
        futures = [pool.submit(_by_name, scene.name, one, quick) for scene, one in jobs]
        for future in as_completed(futures):
            keep(future.result())
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    pool.shutdown()


def _quiet_worker() -> None:
    """A worker leaves Ctrl-C to its parent, and what a naive method warns of is part of the answer."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter("ignore")
    os.environ.setdefault("OMP_NUM_THREADS", "1")


def _by_name(scene: str, configuration: Configuration, quick: bool) -> Cell:
    return run_cell(next(one for one in SCENES if one.name == scene), configuration, quick)


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if isinstance(value, float):
        return float(f"{value:.4g}") if math.isfinite(value) else None
    return value
