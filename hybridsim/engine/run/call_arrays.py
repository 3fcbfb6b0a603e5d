"""Arrays of one call of a compiled loop: the state that it advances, and scratch; later calls reuse them."""

from __future__ import annotations

from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.compiled.after_segment import State
from hybridsim.engine.events.outcome import Outcome
from hybridsim.engine.native.simd_products import filled_up
from hybridsim.engine.native.struct_pack import packed

_NO_MONITORS, _NO_MONITOR_FLOORS = np.zeros(0, dtype=np.int64), np.zeros(0)  # compiled loops have no monitors
_FLOAT_FIELDS, _INT_FIELDS = ("x", "x_error", "p", "floors"), ("z", "sides", "orders")


class StateBuffer(NamedTuple):
    """A state at an instant in the memory layout of compiled loops.

    All real arrays lie in `float_slots` and all integer arrays in `int_slots`, each padded with zeros, so that two
    copies suffice.
    """

    float_slots: np.ndarray
    int_slots: np.ndarray
    slices: dict[str, slice]

    def part(self, name: str) -> np.ndarray:
        """Return one of the arrays by name."""
        return (self.float_slots if name in _FLOAT_FIELDS else self.int_slots)[self.slices[name]]

    def copy(self) -> StateBuffer:
        """Return a copy with its own arrays."""
        return StateBuffer(self.float_slots.copy(), self.int_slots.copy(), self.slices)

    def outcome(self) -> Outcome:
        """Return the state as an `Outcome` that shares the memory."""
        x, x_error, p, floors, z, sides, orders = map(self.part, (*_FLOAT_FIELDS, *_INT_FIELDS))
        return Outcome(
            x, p, z, sides, orders, _NO_MONITORS, _NO_MONITORS, x_error, floors, _NO_MONITOR_FLOORS
        )


def buffer_of(outcome: Outcome, p: np.ndarray) -> StateBuffer:
    """Copy an outcome and the run-time vector p into the memory layout of compiled loops."""
    fields = {
        "x": outcome.x,
        "x_error": outcome.x_error,
        "p": p,
        "floors": outcome.guard_floors,
        "z": outcome.z,
        "sides": outcome.sides,
        "orders": outcome.orders,
    }
    slices = {**_slices(fields, _FLOAT_FIELDS), **_slices(fields, _INT_FIELDS)}
    float_slots = np.zeros(sum(filled_up(len(fields[name])) for name in _FLOAT_FIELDS))
    int_slots = np.zeros(sum(filled_up(len(fields[name])) for name in _INT_FIELDS), dtype=np.int64)
    buffer = StateBuffer(float_slots, int_slots, slices)
    for name, values in fields.items():
        buffer.part(name)[:] = values
    return buffer


class CallArrays(NamedTuple):
    """The arrays of a compiled loop during one call."""

    buffer: StateBuffer  # the state
    state: State  # named views of it
    as_packed: Any  # the same views as kernels receive them
    work: Any  # work space for events
    scratch: Any  # scratch arrays of the kernel
    clock: np.ndarray  # present instant (2,)
    target: np.ndarray  # target instant (2,)

    @classmethod
    def of(cls, like: StateBuffer, work: Any, scratch: Any) -> CallArrays:
        """Return arrays for states with the layout of a given buffer."""
        buffer = like.copy()
        state = State(**{name: buffer.part(name) for name in buffer.slices})
        return cls(buffer, state, packed(state), work, scratch, *np.zeros((2, 2)))

    def set_state(self, buffer: StateBuffer) -> None:
        """Set the state from which the next call starts."""
        self.buffer.float_slots[:], self.buffer.int_slots[:] = buffer.float_slots, buffer.int_slots

    def final_state(self) -> StateBuffer:
        """Return a copy of the state at which the loop ended."""
        return self.buffer.copy()


def _slices(fields: dict[str, np.ndarray], names: tuple[str, ...]) -> dict[str, slice]:
    begins = accumulate((filled_up(len(fields[name])) for name in names), initial=0)
    return {name: slice(k, k + len(fields[name])) for name, k in zip(names, begins, strict=False)}
