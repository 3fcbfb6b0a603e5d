"""This module makes the arrays that compiled runs of a group of points share."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hybridsim.engine.events.compiled.start import surfaces_of
from hybridsim.engine.events.outcome import Outcome
from hybridsim.engine.events.state import HybridState
from hybridsim.engine.linear.motion_summary import NODES, WEIGHTS
from hybridsim.engine.native.kernels import kernel_address
from hybridsim.engine.native.simd.products import vector_of
from hybridsim.engine.native.struct_pack import address_in, packed
from hybridsim.engine.run.event_loop import LoopRecord, link_event_loop
from hybridsim.engine.run.method_kernels import NOT_LINEAR, CallArrays
from hybridsim.engine.system.system import System
from hybridsim.ensemble.newton import close_orbit
from hybridsim.ensemble.period_map import MapScratch
from hybridsim.ensemble.points import (
    BEGIN,
    NEWTON,
    SEARCH,
    SUMMARISE,
    Fixed,
    LoopPacks,
    PeriodSummary,
    Points,
    begin_point,
    summarise,
)
from hybridsim.ensemble.run import SEGMENTS
from hybridsim.ensemble.search import MOST_FOLLOWED, SearchScratch, search_point
from hybridsim.integrators.closed_form.compiled_loop import ClosedFormKernels
from hybridsim.integrators.closed_form.segments import ClosedFormRows


class GroupScratch:
    """Scratch arrays for all runs of a group, also in packed form for kernels.

    Parameters
    ----------
    tables : those of one point.
    points, summaries : arrays like those of each group.

    Attributes
    ----------
    loop, fixed, found, search : the packs `LoopPacks`, `Fixed`, `PeriodSummary` of one point, `SearchScratch`.
    record : the packs `LoopRecord` and `ClosedFormRows` of twice as many segments as one compiled call has.
    """

    def __init__(
        self, system: System, tapes: Any, tables: Any, points: Points, summaries: PeriodSummary
    ) -> None:
        n, widest, count, whole = system.n, tables.values.shape[1], len(system.automata), np.int64
        size, layout = 2 * SEGMENTS, system.layout
        arrays = _call_arrays(system, tapes, tables, points.vectors[0])
        record = LoopRecord(
            clocks=np.empty((size, 2)),
            modes=np.empty((size, count), dtype=whole),
            vectors=np.empty((size, layout.size)),
            last_steps=np.empty(size, dtype=whole),
            fires=np.empty(size, dtype=whole),
            jumps=np.empty((size, 3, n)),
        )
        rows = ClosedFormRows(
            ends=np.empty(size),
            rows=np.empty(size, dtype=whole),
            coordinates=np.empty((size, widest), dtype=complex),
        )
        late, late_rows = (packed(type(part)(*(a[SEGMENTS:] for a in part))) for part in (record, rows))
        loop = arrays.model, arrays.call, arrays.as_packed, arrays.work
        link_event_loop(ClosedFormKernels.loop, *loop, late, arrays.own, late_rows)
        self.record = packed(record), packed(rows)
        entry_points = self._entry_points = np.zeros(4, dtype=whole)
        self.loop = packed(
            LoopPacks(
                *loop,
                arrays.own,
                late,
                late_rows,
                address_in(arrays.model, "lin"),
                entry_points,
                np.zeros((3, n)),
            )
        )
        self.fixed = packed(_fixed(system))
        self.found = packed(PeriodSummary(*(np.empty_like(part[0]) for part in summaries)))
        self.search = packed(_search_scratch(n, count, len(tables.factors), self.found))
        entry_points[BEGIN] = kernel_address(
            begin_point, self.loop, NOT_LINEAR, self.fixed, packed(points), self.found, 0
        )
        entry_points[SUMMARISE] = kernel_address(
            summarise, self.loop, self.fixed, late, late_rows, self.found, 0, 0, 0.0
        )

    def link_search(self, searches: Any) -> None:
        """Compile the kernel of the search for a motion, if the kernel is not compiled yet."""
        if self._entry_points[SEARCH] == 0:
            self._entry_points[SEARCH] = kernel_address(
                search_point, self.loop, self.fixed, searches, self.search, 0, 0.0, 0, 0
            )

    def link_newton(self, searches: Any) -> None:
        """Compile the kernel of Newton's method."""
        self._entry_points[NEWTON] = kernel_address(close_orbit, self.loop, searches, self.search, 0, 0, 0.0)


def _fixed(system: System) -> Fixed:
    """Return the arrays that all points have in common."""
    layout, (constant, rows, derivatives, registers, owners) = system.layout, surfaces_of(system)
    return Fixed(
        positions=np.array([layout.origin_at, layout.phases_at, layout.pin_at], dtype=np.int64),
        hold=np.array([a.hold for a in system.automata], dtype=np.int64),
        constant=constant,
        rows=rows,
        derivatives=derivatives,
        registers=registers,
        owners=owners,
        nodes=NODES,
        weights=WEIGHTS,
    )


def _call_arrays(system: System, tapes: Any, tables: Any, p: np.ndarray) -> CallArrays:
    """Return the arrays of a call of the event loop."""
    kernels = ClosedFormKernels(system, math.inf)
    kernels.lin = tables
    return CallArrays(kernels, HybridState.of(Outcome.blank(system, p.copy()), p), tapes, tables)


def _search_scratch(n: int, components: int, monomials: int, found: Any) -> SearchScratch:
    """Return scratch arrays of a search."""
    return SearchScratch(
        states=np.empty((MOST_FOLLOWED, n)),
        modes=np.empty(components, dtype=np.int64),
        **{name: np.empty(n) for name in ("scale", "seen", "last")},
        rows=np.empty((n, n + 1)),
        map=packed(
            MapScratch(
                matrix=np.empty((n, n)),
                **{name: vector_of(n) for name in ("column", "after", "before_rates", "after_rates")},
                no_time=vector_of(monomials),
            )
        ),
        found=found,
    )
