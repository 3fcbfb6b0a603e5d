"""What a compiled loop works on during one leap: the state that it moves on, and room; handed on from leap to leap."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.outcome import Outcome
from hybridsim.engine.packs import packed
from hybridsim.engine.segment_end import State

_NONE, _NO_FLOORS = np.zeros(0, dtype=np.int64), np.zeros(0)  # there are no monitors where there are leaps


class Desk(NamedTuple):
    """The state, the same as kernels take it, room for events, scratch arrays of the kernel."""

    state: State
    as_packed: Any
    work: Any
    room: Any

    @classmethod
    def of(cls, outcome: Outcome, p: np.ndarray, work: Any, room: Any) -> Desk:
        """A desk for states like this one."""
        state = State(*(array.copy() for array in _fields(outcome, p)))
        return cls(state, packed(state), work, room)

    def take_up(self, outcome: Outcome, p: np.ndarray) -> None:
        """Begin where an outcome holds; p is the run-time vector there."""
        for array, value in zip(self.state, _fields(outcome, p), strict=True):
            array[:] = value

    def outcome(self) -> Outcome:
        """What holds where the loop has ended, in arrays of its own."""
        x, x_error, z, p, sides, orders, floors = [array.copy() for array in self.state]
        return Outcome(x, p, z, sides, orders, _NONE, _NONE, x_error, floors, _NO_FLOORS, continuous=False)


def _fields(outcome: Outcome, p: np.ndarray) -> tuple[np.ndarray, ...]:
    return (
        outcome.x,
        outcome.x_error,
        outcome.z,
        p,
        outcome.sides,
        outcome.orders,
        outcome.guard_floors,
    )
