"""What a compiled loop works on during one leap: the state that it moves on, and room; handed on from leap to leap."""

from __future__ import annotations

from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.compiled.after_segment import State
from hybridsim.engine.events.outcome import Outcome
from hybridsim.engine.native.simd_products import filled_up
from hybridsim.engine.native.struct_pack import packed

_NONE, _NO_FLOORS = np.zeros(0, dtype=np.int64), np.zeros(0)  # there are no monitors where there are leaps
_REAL, _WHOLE = ("x", "x_error", "p", "floors"), ("z", "sides", "orders")


class Laid(NamedTuple):
    """What holds at an instant as a desk has it: arrays one behind the other, real numbers in `real` and whole ones in
    `whole`, each filled up with zeros, so that they are copied in two pieces."""

    real: np.ndarray
    whole: np.ndarray
    slices: dict[str, slice]

    def part(self, name: str) -> np.ndarray:
        """One of the arrays."""
        return (self.real if name in _REAL else self.whole)[self.slices[name]]

    def copy(self) -> Laid:
        """The same with arrays of its own."""
        return Laid(self.real.copy(), self.whole.copy(), self.slices)

    def outcome(self) -> Outcome:
        """The same as everybody else takes it, in the same memory."""
        x, x_error, p, floors, z, sides, orders = map(self.part, (*_REAL, *_WHOLE))
        return Outcome(x, p, z, sides, orders, _NONE, _NONE, x_error, floors, _NO_FLOORS)


def laid_out(outcome: Outcome, p: np.ndarray) -> Laid:
    """What holds, copied, for a desk; p is the run-time vector there."""
    fields = {
        "x": outcome.x,
        "x_error": outcome.x_error,
        "p": p,
        "floors": outcome.guard_floors,
        "z": outcome.z,
        "sides": outcome.sides,
        "orders": outcome.orders,
    }
    slices = {**_slices(fields, _REAL), **_slices(fields, _WHOLE)}
    real = np.zeros(sum(filled_up(len(fields[name])) for name in _REAL))
    whole = np.zeros(sum(filled_up(len(fields[name])) for name in _WHOLE), dtype=np.int64)
    laid = Laid(real, whole, slices)
    for name, values in fields.items():
        laid.part(name)[:] = values
    return laid


class Desk(NamedTuple):
    """The state, the same as kernels take it, room for events, scratch arrays of the kernel; clock and target (2,)."""

    laid: Laid
    state: State
    as_packed: Any
    work: Any
    room: Any
    clock: np.ndarray
    target: np.ndarray

    @classmethod
    def of(cls, like: Laid, work: Any, room: Any) -> Desk:
        """A desk for states like this one."""
        laid = like.copy()
        state = State(**{name: laid.part(name) for name in laid.slices})
        return cls(laid, state, packed(state), work, room, *np.zeros((2, 2)))

    def take_up(self, laid: Laid) -> None:
        """Begin where this holds."""
        self.laid.real[:], self.laid.whole[:] = laid.real, laid.whole

    def leave(self) -> Laid:
        """What holds where the loop has ended."""
        return self.laid.copy()


def _slices(fields: dict[str, np.ndarray], names: tuple[str, ...]) -> dict[str, slice]:
    begins = accumulate((filled_up(len(fields[name])) for name in names), initial=0)
    return {name: slice(k, k + len(fields[name])) for name, k in zip(names, begins, strict=False)}
