"""The matrix of the atlas: all test cases with all methods, run on several processors."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from typing import Any

from hybridsim.arguments import known_name
from hybridsim.errors import UsageError
from hybridsim.files import plain
from hybridsim.integrators.contract import Integrator
from hybridsim.integrators.registry import registered
from hybridsim.testing.atlas.cell import SECONDS, STEPS, Cell, run_cell
from hybridsim.testing.atlas.configurations import Configuration, chosen
from hybridsim.testing.catalogue import SCENES
from hybridsim.testing.scene import TROUBLES, Scene
from hybridsim.testing.verdict import VERDICTS

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Atlas:
    """The results of all methods in all test cases.

    Parameters
    ----------
    cells : cells by names of scene and method.
    interrupted : whether Ctrl-C stopped the atlas, which then contains only the finished scenes.
    """

    scenes: tuple[Scene, ...]
    configurations: tuple[Configuration, ...]
    cells: Mapping[tuple[str, str], Cell]
    interrupted: bool = False

    def row(self, scene: Scene) -> list[Cell]:
        """Return the results in one test case, in the order of the methods."""
        return [self.cells[scene.name, one.name] for one in self.configurations]

    def column(self, configuration: Configuration) -> list[Cell]:
        """Return the cells of a method, in the order of the test cases."""
        return [self.cells[scene.name, configuration.name] for scene in self.scenes]

    def by_class(self) -> dict[str, list[Scene]]:
        """Return the test cases of each class, in the order of the classes."""
        return by_class(self.scenes)

    def table(self) -> str:
        """Return the number of test cases with each verdict, for every method, as text."""
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
        """Return plain data: test cases, methods, and a cell for each pair."""
        return {
            "limits": {"seconds": SECONDS, "steps": STEPS},
            "scenes": [described(scene) for scene in self.scenes],
            "integrators": [asdict(one) for one in self.configurations],
            "cells": [cell.to_plain() for scene in self.scenes for cell in self.row(scene)],
        }

    def to_json(self) -> str:
        """Return JSON text with one line per cell; nan and inf become null."""
        record = plain(self.to_plain(), digits=4)
        parts = []
        for name, part in record.items():
            lines = ",\n".join(json.dumps(item) for item in part) if isinstance(part, list) else ""
            parts.append(f'"{name}": ' + (f"[\n{lines}\n]" if lines else json.dumps(part)))
        return "{\n" + ",\n".join(parts) + "\n}\n"

    @classmethod
    def from_json(cls, text: str) -> Atlas:
        """Return an atlas from the JSON text of `to_json`, with the current descriptions of the test cases."""
        record = json.loads(text)
        scenes = {scene.name: scene for scene in SCENES}
        found = [Cell.from_plain(cell) for cell in record["cells"]]
        return cls(
            tuple(scenes[one["name"]] for one in record["scenes"]),
            tuple(Configuration(**one) for one in record["integrators"]),
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
    """Run test cases with methods and return the matrix of verdicts.

    Parameters
    ----------
    scenes : scenes to run; the default is the packaged scenes.
    integrators : names of integrators or methods, or one `Integrator` class; the default is all.
    quick : whether to run only the loosest setting of each study, which finds gross failures.
    workers : number of processes. With more than one, scenes and integrators must be importable in a new process, and
        a script needs ``if __name__ == "__main__"``.
    progress : function of the finished fraction and the name of the scene; it may raise KeyboardInterrupt.

    Returns
    -------
    The matrix; after Ctrl-C it contains only the finished scenes, and `interrupted` is True.

    Raises
    ------
    UsageError
        For a name that does not exist.
    """
    own = [one for one in integrators or () if not isinstance(one, str)]
    if len(own) > 1 or (own and len(integrators or ()) > 1):
        raise UsageError(
            "an integrator class cannot be combined with other integrators",
            remedy="call atlas() once for each class",
        )
    if own:
        with registered(own[0]) as name:
            return atlas(scenes, (name,), quick=quick, workers=1, progress=progress)
    names = None if integrators is None else tuple(str(one) for one in integrators)
    selected, methods = tuple(SCENES if scenes is None else scenes), chosen(names)
    jobs = [(scene, one) for scene in selected for one in methods]
    cells: dict[tuple[str, str], Cell] = {}

    def store(cell: Cell) -> None:
        # first, because the cell may contain an error that Ctrl-C caused in compiled code
        if progress is not None:
            progress((len(cells) + 1) / len(jobs), cell.scene)
        cells[cell.scene, cell.configuration] = cell

    try:
        if workers > 1:
            _in_processes(jobs, quick, min(workers, len(jobs)), store)
        else:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # warnings of naive methods are expected
                for scene, one in jobs:
                    store(run_cell(scene, one, quick))
    except KeyboardInterrupt:
        done = tuple(s for s in selected if all((s.name, one.name) in cells for one in methods))
        return Atlas(done, methods, cells, interrupted=True)
    return Atlas(selected, methods, cells)


def scenes_named(names: Sequence[str], trouble: str = "") -> tuple[Scene, ...]:
    """Return the packaged test cases with the given names, or of one class; without arguments, all test cases."""
    known = {scene.name: scene for scene in SCENES}
    if trouble:
        known_name(trouble, list(TROUBLES), "Unknown class of scenes", "classes")
    for name in names:
        known_name(name, list(known), "Unknown scene", "scenes")
    of_class = [scene for scene in SCENES if not trouble or scene.trouble == trouble]
    return tuple(known[name] for name in names) or tuple(of_class)


def by_class(scenes: Sequence[Scene]) -> dict[str, list[Scene]]:
    """Return the test cases of each class, in the order of the classes."""
    found = {trouble: [one for one in scenes if one.trouble == trouble] for trouble in (*TROUBLES, "")}
    return {trouble: those for trouble, those in found.items() if those}


def described(scene: Scene) -> dict[str, str]:
    """Return the description of a test case as plain data."""
    return {"name": scene.name, "class": scene.trouble, "title": scene.title, "cause": scene.cause}


def listing(scenes: Sequence[Scene]) -> str:
    """Return names and titles of test cases by class, as text."""
    width = max(len(scene.name) for scene in scenes)
    return "\n\n".join(
        "\n".join(
            [f"{trouble}: {TROUBLES[trouble].partition(': ')[2]}" if trouble else "without a class"]
            + [f"  {scene.name:{width}}  {scene.title}" for scene in those]
        )
        for trouble, those in by_class(scenes).items()
    )


def _in_processes(
    jobs: Sequence[tuple[Scene, Configuration]], quick: bool, workers: int, store: Callable[[Cell], None]
) -> None:
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(
        workers, mp_context=multiprocessing.get_context("spawn"), initializer=_quiet_worker
    )
    try:
        with _signals_later():  # starts the workers
            futures = [pool.submit(_by_name, scene.name, one, quick) for scene, one in jobs]
        for future in as_completed(futures):
            store(future.result())
    except BaseException:  # mainly Ctrl-C: end the workers, then raise it again
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in set(multiprocessing.active_children()) - others:
            worker.terminate()  # a cell may take a minute
        raise
    pool.shutdown()


@contextmanager
def _signals_later() -> Iterator[None]:
    """Delay Ctrl-C while worker processes start, because a terminal sends it to all processes."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _quiet_worker() -> None:
    """Ignore Ctrl-C and warnings in a worker process, because the main process handles them."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter("ignore")  # as in the parent process
    os.environ.setdefault("OMP_NUM_THREADS", "1")


def _by_name(scene: str, configuration: Configuration, quick: bool) -> Cell:
    return run_cell(next(one for one in SCENES if one.name == scene), configuration, quick)
