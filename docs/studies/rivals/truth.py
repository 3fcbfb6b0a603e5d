"""The reference solutions of the runs, which are closed forms in 40 digits and Taylor series in 32."""

from __future__ import annotations

import hashlib
import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hybridsim.reference.multiple_precision import multiple_precision_trajectory
from rivals.method import BACKWARD, FORWARD, STICK, STRUCK, Result
from rivals.scenes import Scene

sys.path.insert(0, str(Path(__file__).parents[3] / "tests"))
from reference.arithmetic import multiprecision
from reference.dfcs_closed_form import Oscillator as ClosedForm

_AFTER = {"stick": STICK, "slip+": FORWARD, "slip-": BACKWARD, "free": STRUCK}
DIGITS = 32


@dataclass(frozen=True)
class Errors:
    """How far a result is off.

    Parameters
    ----------
    states : largest error of a state over the last period, relative to its amplitude there; nan without a grid.
    times : largest error of the time of an event, in periods; nan where the sequence is wrong or not known.
    missing : events that it has too few (negative: too many); None without modes.
    right : whether the sequence of events is right; None without modes.
    """

    states: float
    times: float
    missing: int | None
    right: bool | None


@dataclass(frozen=True)
class Truth:
    """The exact motion: events, and the states on the last period of the grid (k, n)."""

    title: str
    t: np.ndarray
    contact: np.ndarray
    after: np.ndarray
    last: np.ndarray

    def errors(self, scene: Scene, result: Result, has_modes: bool = True) -> Errors:
        """What is wrong with a result."""
        states = math.nan
        if result.grid is not None:
            apart = np.abs(result.grid[scene.last] - self.last)
            states = float(np.max(apart / np.max(np.abs(self.last), axis=0)))
        if not has_modes:
            return Errors(states, math.nan, None, None)
        missing = len(self.t) - len(result.t)
        right = missing == 0 and bool(
            (result.contact == self.contact).all() and (result.after == self.after).all()
        )
        times = float(np.max(np.abs(result.t - self.t))) / scene.period if right and len(self.t) else math.nan
        return Errors(states, times, missing, right)


def truth(scene: Scene, kept: Path | None = None) -> Truth:
    """The exact motion of a scene.

    Parameters
    ----------
    kept : a folder where it is kept for the next time, by a hash of the model and the span.
    """
    known = f"{scene.model.to_toml()}{scene.end!r}{scene.grid[scene.last].tobytes().hex()}{DIGITS}"
    path = kept / f"{scene.name}-{hashlib.sha256(known.encode()).hexdigest()[:16]}.npz" if kept else None
    if path is not None and path.exists():
        with np.load(path) as arrays:
            return Truth(str(arrays["title"]), *(arrays[name] for name in ("t", "contact", "after", "last")))
    found = _closed_form(scene) if scene.oscillator else _series(scene)
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez(path, **vars(found))
    return found


def _closed_form(scene: Scene) -> Truth:
    o = scene.oscillator
    assert o is not None
    system = ClosedForm(o.m, o.c, o.k, o.limit, o.limit, o.F0, o.omega, numbers=multiprecision(40))
    motion = system.run(0, scene.end, 0)
    changes = motion.changes
    states = [[float(value) for value in motion.state(t)[:2]] for t in scene.grid[scene.last]]
    return Truth(
        "closed form with 40 digits",
        np.array([float(c.t) for c in changes]),
        np.zeros(len(changes), dtype=int),
        np.array([c.mode for c in changes]),
        np.array(states),
    )


def _series(scene: Scene) -> Truth:
    motion = multiple_precision_trajectory(scene.model, (0.0, scene.end), digits=DIGITS)
    names = [component.name for component in scene.model.all_components()]
    return Truth(
        f"Taylor series with {DIGITS} digits",
        np.array([e.t for e in motion.events], dtype=float),
        np.array([names.index(e.component) for e in motion.events]),
        np.array([_AFTER[e.target] for e in motion.events]),
        np.asarray(motion.states(scene.grid[scene.last], "+"), dtype=float).T,
    )
