"""This module connects the method `exact` to the compiled event loop: its tables, arrays and results."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from hybridsim.engine.events.state import HybridState
from hybridsim.engine.linear.closed_form_block import ClosedFormBlock
from hybridsim.engine.linear.tables import LinearTables, tables_of
from hybridsim.engine.linear.units import horizon_class
from hybridsim.engine.native.constants import BOUND_TERMS
from hybridsim.engine.native.simd.products import vector_of
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.record.array_forms import check_modes
from hybridsim.engine.record.checkpoint import damaged
from hybridsim.engine.run.method_kernels import MethodKernels
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.known_times import KnownTimes
from hybridsim.engine.system.programs.mode_tables import Tapes, tape_cache_of
from hybridsim.engine.system.system import System
from hybridsim.integrators.closed_form.segments import ClosedFormArrays, ClosedFormRows, closed_form_loop


class ClosedFormKernels(MethodKernels):
    """Connects the method `exact` to the compiled loop of a run."""

    loop = staticmethod(closed_form_loop)
    rows = ClosedFormRows
    is_continued: ClassVar[bool] = False
    remembers: ClassVar[bool] = True
    keeps_starts: ClassVar[bool] = True

    def __init__(self, system: System, longest: float) -> None:
        super().__init__(system, longest)
        self.horizon = self._reach = 0.0  # longest segment that was possible so far
        self._piece = math.inf  # length of the pieces of inputs in the next call
        # as in `ClosedFormArrays.hints` after the last call
        self.hints = np.zeros((0, system.guard_count))
        self.tape_cache = tape_cache_of(system)
        self.tape_cache.with_complete_set()
        self.columns = 0  # number of modal coordinates
        self.lin: LinearTables

    def part_of(self, known: KnownTimes) -> KnownTimes:
        """Return the known times before the first input interval that is much longer or shorter than those before it.

        Tables for long segments would be inaccurate in a short piece. Its coefficients are large, and in a long
        segment they would have large effects. A state has an error relative to these.
        """
        self._piece = float(known.lengths[0])
        return known.of_like_lengths()

    def tables(
        self, tapes: Tapes, state: HybridState, origin: Instant, target: Instant
    ) -> tuple[Any, deque[Any]] | None:
        """Return the tables of linear motion for all modes that have occurred, with arrays for further tables."""
        if self._piece < math.inf:
            self._reach = horizon = self._piece
        else:
            self._reach = max(self.horizon, min(target.minus(origin), self.longest))
            horizon = horizon_class(self._reach)
        found = tables_of(self.system, tapes.modes, state.p, horizon, self._piece < math.inf)
        if found is None:
            self.horizon = self._reach
            return None
        self.lin, self.columns, spare = found
        return self.lin, spare

    def arrays(self) -> Any:
        """Return new arrays for one call of the compiled loop of the method `exact`."""
        tables, widest = self.lin, self.lin.values.shape[1]
        return packed(
            ClosedFormArrays(
                points=np.zeros(2, dtype=np.int64),
                c=np.zeros(widest, dtype=complex),
                v=np.zeros(widest, dtype=complex),
                sizes=vector_of(widest),
                terms=np.zeros((2, BOUND_TERMS)),
                starts=np.zeros((self.system.guard_count, BOUND_TERMS + 2)),
                hints=np.zeros((max(len(tables.counts), len(self.hints)), self.system.guard_count)),
                former=np.zeros(self.system.guard_count),
                series=np.zeros((2, tables.flows.shape[1])),
                products=np.zeros((3, BOUND_TERMS)),
            )
        )

    def fields(self) -> Sequence[tuple[Any, tuple[int, ...]]]:
        """Return the dtype and the row shape of each array in `rows`."""
        return (float, ()), (np.int64, ()), (complex, (self.columns,))

    def begin(self, own: Any, tapes: Tapes) -> Any:
        """Write the last zeros of guards in this run to the arrays, as initial guesses."""
        own, known = self.with_tapes(own, tapes), len(self.hints)
        own.hints[known:] = 0.0
        if known:
            own.hints[:known] = self.hints
        return own

    def with_tapes(self, own: Any, tapes: Tapes) -> Any:
        """Return the arrays with guesses of zeros for all combinations of modes; new combinations have no guess."""
        former, known = own, len(own.hints)
        if known < max(len(self.lin.counts), len(self.hints)):
            own = self.arrays()
            own.hints[:known], own.points[:] = former.hints, former.points
        return own

    def end(self, own: Any, tapes: Tapes, lin: Any) -> Any:
        """Return the data for the next call: the tables, their segment length, and the last zeros of guards."""
        return lin, self._reach, own.hints.copy()

    def take(self, result: Any) -> None:
        """Keep the segment length of the tables and the last zeros of guards for the next call."""
        _, self.horizon, self.hints = result

    def block(
        self, result: Any, rows: ClosedFormRows, last_steps: np.ndarray, *record: np.ndarray
    ) -> ClosedFormBlock:
        """Return the segments that one call of the compiled loop has stored."""
        return ClosedFormBlock(self.recorded, result[0], rows.rows, rows.ends, rows.coordinates, *record)

    @property
    def place(self) -> tuple[np.ndarray, ...]:
        """Return the data that a checkpoint needs: the segment length of the tables, and the last zeros of guards.

        The hints are stored with their mode vectors, because another process has these in other rows.
        """
        count = len(self.hints)
        modes = self.tape_cache.tapes.modes[:count]
        return np.array([self.horizon, float(count)]), modes.ravel().astype(float), self.hints.ravel()

    @place.setter
    def place(self, place: np.ndarray) -> None:
        guards, components = self.system.guard_count, len(self.system.automata)
        whole = len(place) >= 2 and 0.0 <= place[0] < math.inf and 0.0 <= place[1] <= len(place)
        if not whole or len(place) != 2 + int(place[1]) * (components + guards):
            raise damaged("the stored zeros of guards are wrong")
        self.horizon, count = float(place[0]), int(place[1])
        vectors = place[2 : 2 + count * components].reshape(count, components)
        try:
            check_modes("the last zeros of guards", vectors, [len(a.modes) for a in self.system.automata])
        except ValueError:
            raise damaged("the stored zeros of guards are wrong") from None
        hints = place[2 + count * components :].reshape(count, guards)
        is_known = (hints > 0.0).any(axis=1)
        rows = self.tape_cache.rows_of(vectors[is_known].astype(np.int64))
        self.hints = np.zeros((max(rows.tolist(), default=-1) + 1, guards))
        self.hints[rows] = hints[is_known]
