"""This module defines an exact motion: its states over a span, and its events."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    pass


class EventLike(Protocol):
    """The fields of `hybridsim.Event` that a comparison reads."""

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
    """A change of mode of a motion in closed form."""

    t: float
    component: str
    source: str
    target: str
    guard: str = ""
    kind: str = "transition"


@dataclass(frozen=True)
class Trajectory:
    """The states over a span, and the events in this span.

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
