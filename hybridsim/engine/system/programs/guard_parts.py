"""This module extracts from instruction tapes the rows that the guards need."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.series.operations import (
    ADD,
    ADD_CONSTANT,
    CONSTANT_SUB,
    DIVIDE_BY,
    NEG,
    SCALE,
    SUB,
    SUB_CONSTANT,
)
from hybridsim.engine.series.optimise import live_rows
from hybridsim.engine.system.per_structure import per_structure
from hybridsim.engine.system.programs.growing_rows import GrowingArray, GrowingLists
from hybridsim.engine.system.programs.mode_tables import Tapes
from hybridsim.engine.system.system import System
from hybridsim.forks import SharedLock

_LINEAR = (ADD, SUB, NEG, ADD_CONSTANT, SUB_CONSTANT, CONSTANT_SUB, SCALE, DIVIDE_BY)


class Parts(NamedTuple):
    """Rows of instruction tapes for the guards in each combination of modes, and whether the guards are linear.

    The step rows are those that a step needs: of the flow, and of guards that are linear.
    """

    start: np.ndarray
    rows: np.ndarray
    is_linear: np.ndarray
    step_start: np.ndarray
    step_rows: np.ndarray


class GuardParts:
    """Caches the instructions for guards, which depend on the model's structure only."""

    def __init__(self, system: System) -> None:
        self.system = system
        self._known: tuple[Tapes, Parts] | None = None
        self._lock, self._count = SharedLock(), 0
        self._guards, self._steps, self._is_linear = (
            GrowingLists(),
            GrowingLists(),
            GrowingArray((), np.bool_),
        )

    def of(self, tapes: Tapes) -> Parts:
        """Return the instructions for the guards of the given tapes."""
        known = self._known  # read once, because other threads may replace it
        if known is None or known[0] is not tapes:
            self._known = known = tapes, self._parts(tapes)
        return known[1]

    def _parts(self, tapes: Tapes) -> Parts:
        with self._lock:
            count = len(tapes.modes)
            for k in range(self._count, count):
                guards, is_linear, steps = _mode_parts(self.system, tapes.modes[k])
                self._guards.put(k, guards)
                self._steps.put(k, steps)
                self._is_linear.put(k, [is_linear])
                self._count = k + 1
            flags = self._is_linear.up_to(count)
            parts: Parts = packed(Parts(*self._guards.up_to(count), flags, *self._steps.up_to(count)))
        return parts


guard_parts_of = per_structure(GuardParts)


def _mode_parts(system: System, z: np.ndarray) -> tuple[np.ndarray, bool, np.ndarray]:
    """Return the rows that compute the guards, whether guards are linear, and the rows that a step computes."""
    tape = system.optimised_tape(z)
    guard_registers, rates = tape.guards[system.active(z)], tape.derivatives
    guards = live_rows(tape.rows, guard_registers)
    is_linear = bool(np.isin(guards[:, 0], _LINEAR).all())
    return guards, is_linear, live_rows(tape.rows, [*rates, *guard_registers] if is_linear else rates)
