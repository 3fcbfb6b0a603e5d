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
    """Rows for the guards of each vector of modes, one slice each, and whether these are linear in states and time.

    The other rows are those that a step needs: of the flow, and of guards where they are linear.
    """

    start: np.ndarray
    rows: np.ndarray
    is_linear: np.ndarray
    step_start: np.ndarray
    step_rows: np.ndarray


class GuardParts:
    """The parts of the tapes last seen; they follow from the structure of a model alone."""

    def __init__(self) -> None:
        self._known: tuple[Tapes, Parts] | None = None

    def of(self, tapes: Tapes) -> Parts:
        """The parts of these tapes."""
        known = self._known  # read once: other threads may put theirs in its place at any time
        if known is None or known[0] is not tapes:
            self._known = known = tapes, _parts(tapes)
        return known[1]


def _parts(tapes: Tapes) -> Parts:
    guards, steps, is_linear = [], [], []
    for k in range(len(tapes.modes)):
        lean = [tuple(row) for row in tapes.lean[tapes.lean_start[k] : tapes.lean_start[k + 1]].tolist()]
        active = tapes.active[tapes.active_start[k] : tapes.active_start[k + 1]]
        watched, rates = set(tapes.guards[k, active].tolist()), set(tapes.derivatives[k].tolist())
        guards.append(needed_rows(lean, watched))
        is_linear.append(all(row[0] in _LINEAR for row in guards[-1]))
        steps.append(needed_rows(lean, rates | watched if is_linear[-1] else rates))
    parts: Parts = packed(Parts(*_flat(guards), np.array(is_linear, dtype=np.bool_), *_flat(steps)))
    return parts


def _flat(lists: list[list[tuple[int, ...]]]) -> tuple[np.ndarray, np.ndarray]:
    """Where each of several lists of rows begins, and all of them in a row."""
    start = np.cumsum([0, *map(len, lists)]).astype(np.int64)
    return start, np.array([row for rows in lists for row in rows], dtype=np.int64).reshape(-1, 5)
