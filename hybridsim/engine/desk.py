"""What a compiled loop works on during one leap: the state that it moves on, and room; handed on from leap to leap."""

from __future__ import annotations

from collections.abc import Callable
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.outcome import Outcome
from hybridsim.engine.packs import packed
from hybridsim.engine.panels import filled_up
from hybridsim.engine.segment_end import State

_NONE, _NO_FLOORS = np.zeros(0, dtype=np.int64), np.zeros(0)  # there are no monitors where there are leaps
_REAL, _WHOLE = ("x", "x_error", "p", "floors"), ("z", "sides", "orders")


class Desk(NamedTuple):
    """The state, the same as kernels take it, room for events, scratch arrays of the kernel.

    The arrays of the state lie one behind the other, real numbers in `real` and whole ones in `whole`, each filled up
    with zeros: so they are copied in two pieces.
    """

    state: State
    as_packed: Any
    work: Any
    room: Any
    real: np.ndarray
    whole: np.ndarray
    slices: dict[str, slice]

    @classmethod
    def of(cls, outcome: Outcome, p: np.ndarray, work: Any, room: Any) -> Desk:
        """A desk for states like this one."""
        fields = _fields(outcome, p)
        slices = {**_slices(fields, _REAL), **_slices(fields, _WHOLE)}
        real = np.zeros(sum(filled_up(len(fields[name])) for name in _REAL))
        whole = np.zeros(sum(filled_up(len(fields[name])) for name in _WHOLE), dtype=np.int64)
        parts = {name: (real if name in _REAL else whole)[part] for name, part in slices.items()}
        state = State(**parts)
        return cls(state, packed(state), work, room, real, whole, slices)

    def take_up(self, outcome: Outcome, p: np.ndarray) -> None:
        """Begin where an outcome holds; p is the run-time vector there."""
        state = self.state
        state.x[:], state.x_error[:], state.p[:], state.floors[:] = (
            outcome.x,
            outcome.x_error,
            p,
            outcome.guard_floors,
        )
        state.z[:], state.sides[:], state.orders[:] = outcome.z, outcome.sides, outcome.orders

    def leave(self) -> tuple[np.ndarray, Callable[[], Outcome]]:
        """The modes where the loop has ended, and what makes all that holds there, from copies."""
        real, whole, slices = self.real.copy(), self.whole.copy(), self.slices

        def outcome() -> Outcome:
            x, x_error, p, floors = (real[slices[name]] for name in _REAL)
            z, sides, orders = (whole[slices[name]] for name in _WHOLE)
            return Outcome(x, p, z, sides, orders, _NONE, _NONE, x_error, floors, _NO_FLOORS)

        return whole[slices["z"]], outcome


def _fields(outcome: Outcome, p: np.ndarray) -> dict[str, np.ndarray]:
    return {
        "x": outcome.x,
        "x_error": outcome.x_error,
        "p": p,
        "floors": outcome.guard_floors,
        "z": outcome.z,
        "sides": outcome.sides,
        "orders": outcome.orders,
    }


def _slices(fields: dict[str, np.ndarray], names: tuple[str, ...]) -> dict[str, slice]:
    begins = accumulate((filled_up(len(fields[name])) for name in names), initial=0)
    return {name: slice(k, k + len(fields[name])) for name, k in zip(names, begins, strict=False)}
