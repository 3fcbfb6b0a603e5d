"""What every method of the study gives: a run of a scene ready to be timed, and its result in plain arrays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from rivals.scenes import Scene

STICK, FORWARD, BACKWARD, STRUCK = 0, 1, -1, 2


@dataclass(frozen=True)
class Result:
    """Events in order (time, contact, what follows: 0, 1, -1, or 2 for an impact; state), and states on the grid."""

    t: np.ndarray
    contact: np.ndarray
    after: np.ndarray
    x: np.ndarray
    grid: np.ndarray | None = None


@dataclass(frozen=True)
class Runs:
    """A scene in a method's hands.

    Parameters
    ----------
    events, grid : the runs that are timed: with events alone, and with the states on the grid besides. None where
        the method has no such thing.
    read : makes a `Result` of what they return, which is not timed.
    parts : makes of what they return the seconds spent in its compiled loop, where the method tells.
    """

    events: Callable[[], Any] | None
    grid: Callable[[], Any]
    read: Callable[[Any], Result]
    parts: Callable[[Any], float] | None = None


@dataclass(frozen=True)
class Method:
    """A method in one setting.

    Parameters
    ----------
    name, label : for the command line and for tables.
    family : what it is drawn as: "ours", "rival", "limit" or "published".
    start : a scene's runs; None where the method does not apply. What it needs for building is timed.
    has_modes : whether its events can be judged.
    shown : whether it stands in the charts; other settings are there for the ratios.
    has_threads : whether it computes on threads of its own, whose processor time the system tells late: its calls are
        timed by the clock.
    """

    name: str
    label: str
    family: str
    start: Callable[[Scene], Runs | None]
    has_modes: bool = True
    shown: bool = True
    has_threads: bool = False


def columns(rows: list[tuple[float, int, int]], states: list[Any], n: int) -> tuple[np.ndarray, ...]:
    """Event times, contacts, what follows, and states as arrays."""
    t = np.array([row[0] for row in rows], dtype=float)
    contact = np.array([row[1] for row in rows], dtype=int)
    after = np.array([row[2] for row in rows], dtype=int)
    return t, contact, after, np.array(states, dtype=float).reshape(len(rows), n)
