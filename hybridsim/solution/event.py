"""This module defines the events of a run and the time intervals between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Event:
    """An event of a run: a change of mode, an impact, a monitor or anything else recorded at one instant.

    Parameters
    ----------
    t : float
        Time, rounded to a double, in the model's unit.
    kind : str
        "transition", "monitor", "scheduled" or "near-grazing".
    component : str
        Name of the component, monitor or schedule.
    guard : str
        Name of the guard that fired, if one did.
    source, target : str
        Modes before and after; empty if no mode changed.
    direction : int
        -1 falling, +1 rising, 0 if it has no meaning.
    x_minus, x_plus : array
        States (n,) just before and just after.

    Examples
    --------
    >>> import hybridsim as hs
    >>> hs.simulate("dfcs", (0, 0.1)).events[0]
    <transition f stick -> slip+ at t = 0.00171998458>
    """

    t: float
    kind: str
    component: str
    guard: str
    source: str
    target: str
    direction: int
    x_minus: np.ndarray
    x_plus: np.ndarray

    def __eq__(self, other: object) -> bool:
        """Return whether all fields of two events are equal; NaN states count as equal."""
        if not isinstance(other, Event):
            return NotImplemented
        states = ((self.x_minus, other.x_minus), (self.x_plus, other.x_plus))
        return self._what == other._what and all(np.array_equal(*pair, equal_nan=True) for pair in states)

    def __hash__(self) -> int:
        return hash(self._what)

    @property
    def _what(self) -> tuple[float | str, ...]:
        """All fields except the states, which are compared separately and are not hashed."""
        return self.t, self.kind, self.component, self.guard, self.source, self.target, self.direction

    def __repr__(self) -> str:
        change = f" {self.source} -> {self.target}" if self.source or self.target else ""
        return f"<{self.kind} {self.component}{change} at t = {self.t:.9g}>"


def counted_kind(kind: str, count: int) -> str:
    """Return the number of events of one kind as text, such as "2 transitions"."""
    return f"{count} {kind}{'s' * (count > 1 and kind != 'scheduled')}"


@dataclass(frozen=True)
class ModeInterval:
    """A time interval that a component spent in one mode."""

    mode: str
    t0: float
    t1: float
