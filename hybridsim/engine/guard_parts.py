"""Of the tapes on a shelf, what the guards alone need: fewer rows than the flow, and often only linear ones."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybridsim.engine.lean_tape import ADD_CONSTANT, CONSTANT_SUB, DIVIDE_BY, SCALE, SUB_CONSTANT, needed_rows
from hybridsim.engine.mode_tables import Tapes
from hybridsim.engine.packs import packed
from hybridsim.engine.tape import ADD, NEG, SUB

_LINEAR = {ADD, SUB, NEG, ADD_CONSTANT, SUB_CONSTANT, CONSTANT_SUB, SCALE, DIVIDE_BY}


class Parts(NamedTuple):
    """Rows for the guards of each vector of modes, one slice each, and whether these are linear in states and time."""

    start: np.ndarray
    rows: np.ndarray
    is_linear: np.ndarray


class GuardParts:
    """The parts of the tapes last seen; they follow from the structure of a model alone."""

    def __init__(self) -> None:
        self._known: tuple[Tapes, Parts] | None = None

    def of(self, tapes: Tapes) -> Parts:
        """The parts of these tapes."""
        if self._known is None or self._known[0] is not tapes:
            self._known = tapes, _parts(tapes)
        return self._known[1]


def _parts(tapes: Tapes) -> Parts:
    start, rows, is_linear = [0], [np.zeros((0, 5), dtype=np.int64)], []
    for k in range(len(tapes.modes)):
        lean = tapes.lean[tapes.lean_start[k] : tapes.lean_start[k + 1]]
        active = tapes.active[tapes.active_start[k] : tapes.active_start[k + 1]]
        needed = needed_rows([tuple(row) for row in lean.tolist()], set(tapes.guards[k, active].tolist()))
        rows.append(np.array(needed, dtype=np.int64).reshape(-1, 5))
        start.append(start[-1] + len(needed))
        is_linear.append(all(row[0] in _LINEAR for row in needed))
    parts: Parts = packed(
        Parts(np.array(start, dtype=np.int64), np.concatenate(rows), np.array(is_linear, dtype=np.bool_))
    )
    return parts
