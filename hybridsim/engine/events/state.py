"""The state of a hybrid system at an instant, in one block of memory for compiled loops."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.outcome import Outcome
from hybridsim.engine.native.simd.products import filled_up
from hybridsim.engine.native.struct_pack import packed

_NO_MONITORS, _NO_MONITOR_FLOORS = np.zeros(0, dtype=np.int64), np.zeros(0)  # compiled loops have no monitors


class StateArrays(NamedTuple):
    """The arrays of a `HybridState` for kernels."""

    x: np.ndarray  # states (n,)
    x_error: np.ndarray  # error bounds (n,)
    p: np.ndarray  # run-time vector
    floors: np.ndarray  # error bounds (G,) of the guards
    z: np.ndarray  # modes (C,)
    sides: np.ndarray  # sides (G,) of the guards
    orders: np.ndarray  # leading zeros (G,) of the guards


_FIELDS = StateArrays._fields
_ONE = np.ones(1, dtype=np.int64).view(float)[0]  # a double with the bits of the integer 1
_INTEGERS = ("z", "sides", "orders")


class _Layout:
    """The positions of the arrays in the memory of a state, counted in doubles."""

    def __init__(self, lengths: Sequence[int]) -> None:
        *begins, self.size = accumulate(map(filled_up, lengths), initial=0)
        # shape, dtype, and offset in bytes
        self.views = {
            name: ((length,), np.dtype(np.int64 if name in _INTEGERS else float), 8 * begin)
            for name, length, begin in zip(_FIELDS, lengths, begins, strict=True)
        }
        at = dict(zip(_FIELDS, begins, strict=True))
        self.floors, self.tail = slice(at["floors"], at["z"]), slice(at["sides"], None)
        self.not_zero = np.zeros(self.size - at["sides"])  # sides and orders if no guard is zero
        self.not_zero[: at["orders"] - at["sides"]] = _ONE


class HybridState:
    """A state in one block of memory, with the arrays of `StateArrays` as attributes.

    Each array is padded with zeros. Integers lie in the same block as doubles.
    """

    x: np.ndarray
    x_error: np.ndarray
    p: np.ndarray
    floors: np.ndarray
    z: np.ndarray
    sides: np.ndarray
    orders: np.ndarray

    def __init__(self, memory: np.ndarray, layout: _Layout) -> None:
        self.memory, self._layout = memory, layout

    @classmethod
    def of(cls, outcome: Outcome, p: np.ndarray) -> HybridState:
        """Return the state of a finished event, with the run-time vector `p`."""
        fields = StateArrays(
            outcome.x, outcome.x_error, p, outcome.guard_floors, outcome.z, outcome.sides, outcome.orders
        )
        layout = _Layout([len(values) for values in fields])
        state = cls(np.zeros(layout.size), layout)
        for name, values in zip(_FIELDS, fields, strict=True):
            getattr(state, name)[:] = values
        return state

    def __getattr__(self, name: str) -> np.ndarray:
        """Make the view of an array in this memory block when it is first read."""
        if name not in _FIELDS:
            raise AttributeError(name)
        shape, dtype, offset = self._layout.views[name]
        values: np.ndarray = np.ndarray(shape, dtype, self.memory, offset)
        setattr(self, name, values)
        return values

    def divide(self) -> None:
        """Mark this state as the start of a new segment in the same modes, with no guard at zero."""
        memory, layout = self.memory, self._layout  # views of arrays cost more than this
        memory[layout.floors], memory[layout.tail] = 0.0, layout.not_zero

    def copy(self) -> HybridState:
        """Return a copy with its own memory."""
        return HybridState(self.memory.copy(), self._layout)

    def packed(self) -> Any:
        """Return the arrays in packed form for kernels; the pack keeps their memory alive."""
        return packed(StateArrays(*(getattr(self, name) for name in _FIELDS)))

    def outcome(self) -> Outcome:
        """Return the state as an `Outcome` that shares its memory."""
        memory = self.memory
        x, x_error, p, floors, z, sides, orders = [
            np.ndarray(shape, dtype, memory, offset) for shape, dtype, offset in self._layout.views.values()
        ]
        return Outcome(
            x, p, z, sides, orders, _NO_MONITORS, _NO_MONITORS, x_error, floors, _NO_MONITOR_FLOORS
        )
