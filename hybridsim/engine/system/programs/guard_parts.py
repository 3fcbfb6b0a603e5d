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
from hybridsim.engine.system.programs.mode_tables import Tapes, in_a_row
from hybridsim.engine.system.system import System

_LINEAR = {ADD, SUB, NEG, ADD_CONSTANT, SUB_CONSTANT, CONSTANT_SUB, SCALE, DIVIDE_BY}


class Parts(NamedTuple):
    """Rows of instruction tapes for the guards in each combination of modes, and whether the guards are linear.

    The step rows are those that a step needs: of the flow, and of guards that are linear.
    """

    start: np.ndarray
    rows: np.ndarray
    is_linear: np.ndarray
    step_start: np.ndarray
    step_rows: np.ndarray


class _ModeParts(NamedTuple):
    """Rows of an instruction tape for the guards in one combination of modes."""

    guards: np.ndarray
    is_linear: bool
    steps: np.ndarray


class GuardParts:
    """Caches the instructions for guards, which depend on the model's structure only."""

    def __init__(self, system: System) -> None:
        self.system = system
        self._known: tuple[Tapes, Parts] | None = None

    def of(self, tapes: Tapes) -> Parts:
        """Return the instructions for the guards of the given tapes."""
        known = self._known  # read once, because other threads may replace it
        if known is None or known[0] is not tapes:
            self._known = known = tapes, self._parts(tapes)
        return known[1]

    def _parts(self, tapes: Tapes) -> Parts:
        found = [_mode_parts(self.system, modes.tobytes()) for modes in tapes.modes]
        parts: Parts = packed(
            Parts(
                *in_a_row([one.guards for one in found]),
                np.array([one.is_linear for one in found], dtype=np.bool_),
                *in_a_row([one.steps for one in found]),
            )
        )
        return parts


guard_parts_of = per_structure(GuardParts)


@per_structure
def _mode_parts(system: System, modes: bytes) -> _ModeParts:
    z = np.frombuffer(modes, dtype=np.int64)
    tape = system.optimised_tape(z)
    optimised_rows = [tuple(row) for row in tape.rows.tolist()]
    guard_registers, rates = set(tape.guards[system.active(z)].tolist()), set(tape.derivatives.tolist())
    guards = live_rows(optimised_rows, guard_registers)
    is_linear = all(row[0] in _LINEAR for row in guards)
    steps = live_rows(optimised_rows, rates | guard_registers if is_linear else rates)
    guard_rows, step_rows = (np.array(part, dtype=np.int64).reshape(-1, 5) for part in (guards, steps))
    return _ModeParts(guard_rows, is_linear, step_rows)
