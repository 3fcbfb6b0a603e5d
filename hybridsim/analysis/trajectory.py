"""This module defines the data that a comparison needs of a run, an exact motion or a user's reference."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from hybridsim.errors import UsageError

if TYPE_CHECKING:
    from hybridsim.solution import Solution


class EventLike(Protocol):
    """The fields of an event that a comparison reads; `hybridsim.Event` has them."""

    @property
    def t(self) -> float: ...
    @property
    def kind(self) -> str: ...
    @property
    def component(self) -> str: ...
    @property
    def guard(self) -> str: ...
    @property
    def source(self) -> str: ...
    @property
    def target(self) -> str: ...


@dataclass(frozen=True)
class ExactEvent:
    """A change of mode of a closed form."""

    t: float
    component: str
    source: str
    target: str
    guard: str = ""
    kind: str = "transition"


@dataclass(frozen=True)
class Trajectory:
    """States over a span, and the events in it.

    Parameters
    ----------
    states : function of times (k,) and a side "+" or "-" (after or before an event) that returns (n, k).
    t_span : first and last time.
    events : in order of time.
    initial_modes : mode of each component just after the first time.
    """

    states: Callable[[NDArray[np.float64], str], NDArray[np.float64]]
    t_span: tuple[float, float]
    events: tuple[EventLike, ...] = ()
    initial_modes: Mapping[str, str] = field(default_factory=dict)


def trajectory_of(solution: Solution) -> Trajectory:
    """Return the trajectory of a run."""
    return Trajectory(
        states=solution,
        t_span=(solution.t_start, solution.t_end),
        events=tuple(solution.events),
        initial_modes={name: intervals[0].mode for name, intervals in solution.modes.items() if intervals},
    )


def as_trajectory(value: Any, t_span: tuple[float, float]) -> Trajectory:
    """Return a trajectory from a Trajectory, an object like a Solution, or a function t -> states."""
    if isinstance(value, Trajectory):
        return value
    if all(hasattr(value, name) for name in ("t_end", "events", "modes")):
        return trajectory_of(value)
    if callable(value):
        return Trajectory(lambda t, side: np.asarray(value(t), dtype=float), t_span)
    raise UsageError(
        f"reference is a {type(value).__name__}",
        remedy="give a Solution, a Trajectory, a function t -> states, 'closed form' or 'runs'",
    )
