"""This module stores the instructions for high orders of Taylor series, for all combinations of modes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.system.per_structure import per_structure
from hybridsim.engine.system.programs.growing_rows import GrowingLists
from hybridsim.engine.system.programs.mode_tables import Tapes
from hybridsim.engine.system.system import System
from hybridsim.forks import SharedLock


class HighParts(NamedTuple):
    """The instructions for high orders of Taylor series, for several combinations of modes."""

    start: np.ndarray
    rows: np.ndarray


class HighPartsCache:
    """Caches the instructions for high orders of Taylor series, once for each structure of models."""

    def __init__(self, system: System) -> None:
        self.system, self._lists, self._count, self._lock = system, GrowingLists(), 0, SharedLock()
        self._known: tuple[Tapes, HighParts] | None = None

    def of(self, tapes: Tapes) -> HighParts:
        """Return the instructions for high orders that belong to the given tapes."""
        known = self._known  # read once, because other threads may replace it
        if known is None or known[0] is not tapes:
            with self._lock:
                count = len(tapes.modes)
                for k in range(self._count, count):
                    rows = self.system.high_rows(tapes.modes[k])
                    self._lists.put(k, np.array(rows, dtype=np.int64).reshape(-1, 5))
                    self._count = k + 1
                self._known = known = tapes, packed(HighParts(*self._lists.up_to(count)))
        return known[1]


high_parts_of = per_structure(HighPartsCache)
