"""This module makes the arrays that compiled runs of a group of points share."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hybridsim.engine.events.outcome import Outcome
from hybridsim.engine.events.state import HybridState
from hybridsim.engine.linear.motion_summary import MotionSummary
from hybridsim.engine.native.simd.products import vector_of
from hybridsim.engine.native.struct_pack import address_in, opaque, packed
from hybridsim.engine.run.event_loop import LoopRecord, link_event_loop
from hybridsim.engine.run.method_kernels import CallArrays
from hybridsim.engine.system.system import System
from hybridsim.ensemble.period_map import LoopPacks, MapScratch
from hybridsim.ensemble.run import SEGMENTS
from hybridsim.ensemble.search import MOST_FOLLOWED, SearchScratch
from hybridsim.integrators.closed_form.compiled_loop import ClosedFormKernels
from hybridsim.integrators.closed_form.segments import ClosedFormRows


class GroupScratch:
    """Scratch arrays for runs with tables of equal shapes, and packs of the arrays."""

    def __init__(self, system: System, tapes: Any, tables: Any, p: np.ndarray) -> None:
        n, widest, count, whole = system.n, tables.values.shape[1], len(system.automata), np.int64
        none, guards = np.zeros(0, dtype=whole), system.guard_count
        blank = Outcome(
            np.zeros(n), p.copy(), np.zeros(count, dtype=whole), np.ones(guards, dtype=whole),
            np.zeros(guards, dtype=whole), none, none, np.zeros(n), np.zeros(guards), np.zeros(0),
        )  # fmt: skip
        kernels = ClosedFormKernels(system, math.inf)
        kernels.lin = tables
        arrays = CallArrays(kernels, HybridState.of(blank, p), tapes, tables)
        size = 2 * SEGMENTS
        record = LoopRecord(
            clocks=np.empty((size, 2)),
            modes=np.empty((size, count), dtype=whole),
            vectors=np.empty((size, system.layout.size)),
            last_steps=np.empty(size, dtype=whole),
            fires=np.empty(size, dtype=whole),
            jumps=np.empty((size, 3, n)),
        )
        rows = ClosedFormRows(
            ends=np.empty(size),
            rows=np.empty(size, dtype=whole),
            coordinates=np.empty((size, widest), dtype=complex),
        )
        found = MotionSummary(
            extremes=np.empty((2, n)),
            integrals=np.empty((2, n)),
            ends=np.empty((2, n)),
            held=np.empty((2, count)),
            holding=np.empty((2, count), dtype=np.bool_),
        )
        late, late_rows = (packed(type(part)(*(a[SEGMENTS:] for a in part))) for part in (record, rows))
        link_event_loop(
            kernels.loop,
            arrays.model,
            arrays.call,
            arrays.as_packed,
            arrays.work,
            late,
            arrays.own,
            late_rows,
        )
        self.model = arrays.model
        self.lin_at = address_in(arrays.model, "lin")
        self.packs = (
            arrays.as_packed, arrays.work, arrays.call, arrays.own, (late, opaque(arrays.own), opaque(late_rows)),
            (packed(record), packed(rows)), packed(found),
        )  # fmt: skip
        self.slopes = np.zeros((3, n))
        self.loop = packed(
            LoopPacks(arrays.model, arrays.call, arrays.as_packed, arrays.work, arrays.own, late, late_rows)
        )
        self.search = packed(
            SearchScratch(
                states=np.empty((MOST_FOLLOWED, n)),
                modes=np.empty(count, dtype=whole),
                scale=np.empty(n),
                seen=np.empty(n),
                rows=np.empty((n, n + 1)),
                slopes=self.slopes,
                map=packed(
                    MapScratch(
                        matrix=np.empty((n, n)),
                        column=vector_of(n),
                        after=vector_of(n),
                        before_rates=vector_of(n),
                        after_rates=vector_of(n),
                        no_time=vector_of(len(tables.factors)),
                    )
                ),
                summary=self.packs[-1],
            )
        )
