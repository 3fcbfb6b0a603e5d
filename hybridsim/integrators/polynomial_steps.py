"""This module contains the base class and compiled functions for methods with polynomial dense output.

A segment kernel takes steps and fits a polynomial to each. The kernels here begin a segment, find the first zero of a
guard along a polynomial, compute guards at the end of a step, and write the end of the segment for the event loop.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Any, ClassVar, NamedTuple

import numpy as np

from hybridsim.engine.events.compiled.at_end import may_vanish
from hybridsim.engine.events.compiled.known_time import SEGMENTS, STEPS
from hybridsim.engine.events.compiled.scratch import called_by, note_or_restore
from hybridsim.engine.native.kernels import call as call_function
from hybridsim.engine.native.kernels import call_noinline, call_series, inlined, kernel
from hybridsim.engine.native.loop_hints import put
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.roots.dense_guards import first_guard, guard_search
from hybridsim.engine.run.event_loop import (
    FOLLOWED,
    FULL,
    MIN_STEPS_IN_PART,
    STOPPED,
    SegmentEnd,
    any_holding,
    any_projecting,
    load_constants,
    not_followed,
)
from hybridsim.engine.run.method_kernels import StepKernels
from hybridsim.engine.series.interpreter import advance
from hybridsim.engine.system.programs.code_cache import ends_codes
from hybridsim.engine.system.programs.guard_parts import guard_parts_of
from hybridsim.engine.system.programs.mode_tables import Tapes, tape_cache_of
from hybridsim.engine.system.series_at import short_order
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tolerances import Tolerances

TERMS = 3  # Taylor coefficients of guards at the end of a step: value, slope and bend
CONTINUES = -1  # a segment takes another step
TRIED, REJECTED, TAKEN = range(3)  # indices of `PolynomialArrays.counts`
RTOL, MAX_STEP = range(2)  # indices of `PolynomialArrays.control`


class PolynomialArrays(NamedTuple):
    """Arrays of a segment kernel, for n states, G guards, R registers, and guard series up to `order`."""

    method: Any  # arrays of the method
    parts: Any  # `hybridsim.engine.system.programs.guard_parts.Parts` of the tapes
    codes: Any  # `hybridsim.engine.system.programs.code_cache.EndsCodes` of the tapes
    control: np.ndarray  # rtol, longest step
    atol: np.ndarray  # (n,)
    counts: np.ndarray  # evaluated rates, rejected steps and steps of the segment, and all three at its start
    polynomial: np.ndarray  # (n, degree + 1), states in powers of the time since the start of the step
    guards: np.ndarray  # (G, TERMS), Taylor coefficients of the active guards along the flow
    x: np.ndarray  # (n, TERMS), the same of the states
    search: Any  # `hybridsim.engine.roots.dense_guards.GuardSearch`


class PolynomialKernels(StepKernels):
    """The kernels of a method whose steps have polynomials of one degree as dense output."""

    degree: ClassVar[int]

    def __init__(self, system: System, tolerances: Tolerances, longest: float) -> None:
        super().__init__(system, longest, self.degree + 1)
        self.tolerances, self.order = tolerances, max(short_order(tolerances.rtol), self.degree + 2)
        self.kind = f"{type(self).__module__}.{type(self).__qualname__}, order {self.order}"
        self.parts, self.codes = guard_parts_of(system), ends_codes(system, TERMS, TERMS, self.order)

    @abstractmethod
    def method_arrays(self) -> Any:
        """Return a named tuple of the arrays that the method needs for one call."""

    def arrays(self) -> PolynomialArrays:
        """Return new arrays for one call of the compiled loop."""
        system, n = self.system, self.system.n
        arrays: PolynomialArrays = packed(
            PolynomialArrays(
                method=packed(self.method_arrays()),
                **self.of_tapes(tape_cache_of(system).tapes),
                control=np.empty(2),
                atol=np.empty(n),
                counts=np.zeros(6, dtype=np.int64),
                polynomial=np.empty((n, self.degree + 1)),
                guards=np.empty((system.guard_count, TERMS)),
                x=np.empty((n, TERMS)),
                search=guard_search(system, self.order),
            )
        )
        return arrays

    def begin(self, own: PolynomialArrays, tapes: Tapes) -> Any:
        """Write the settings of the run to the arrays, and return the arrays."""
        own.control[RTOL], own.control[MAX_STEP] = self.tolerances.rtol, self.tolerances.max_step
        own.atol[:], own.counts[:] = self.tolerances.atol, 0
        return self.with_tapes(own, tapes)

    def end(self, own: PolynomialArrays, tapes: Tapes, lin: Any) -> Any:
        """Return the numbers of evaluated rates and of rejected steps."""
        self.codes.look(tapes, own.codes)
        return own.counts.tolist()

    def count(self, counters: Any, steps: int, result: Any) -> None:
        """Add the cost of the steps to the counters."""
        counters.rhs_evaluations += result[TRIED]
        counters.rejected += result[REJECTED]


@inlined
def project(model: Any, work: Any, state: Any, s: float, x: Any) -> None:
    """Project the states at the end of a step onto the held surfaces, if a mode requires a projection."""
    if any_projecting(model.automata, state.z):
        call_function(called_by(work).project, s, x, state.p, state.z, work.slopes)
        put(work.slopes, x)


@inlined
def put_sides(state: Any, own: Any) -> None:
    """Set the sign of each guard to its sign at the start of the segment."""
    put(state.sides, own.search.sides)
    put(state.orders, own.search.orders)
    put(state.floors, own.search.floors)


@inlined
def begin_segment(start: Any, model: Any, call: Any, state: Any, work: Any, own: Any) -> bool:
    """Prepare the integration up to the next event from the states in ``work.y``; return False after a rejection."""
    tapes, inputs, k = model.tapes, model.inputs, start.mode_row
    load_constants(inputs, tapes, k, state.p, own.search.V)
    load_constants(inputs, tapes, k, state.p, own.search.W)
    first = tapes.active_start[k]
    for i in range(tapes.active_start[k + 1] - first):
        own.search.guard_registers[i] = tapes.guards[k, tapes.active[first + i]]
    put_sides(state, own)
    put(state.x, work.y)
    for i in range(state.x.shape[0]):
        call.scale[i] = abs(state.x[i])
    note_or_restore(own.counts, start.is_rejected, work)
    own.counts[TAKEN] = 0
    return not start.is_rejected


@inlined
def next_step(call: Any, own: Any, rows: Any, s: float) -> int:
    """Return CONTINUES if the segment may take another step from the local time s, otherwise the reason to leave it."""
    taken = own.counts[TAKEN]
    if s > call.longest[0]:
        return STOPPED
    if call.int_slots[STEPS] + taken < rows.steps.shape[0]:
        return CONTINUES
    return FULL if call.int_slots[SEGMENTS] > 0 or taken < MIN_STEPS_IN_PART else FOLLOWED


@inlined
def first_zero(start: Any, model: Any, own: Any, s: float, d: float) -> tuple[int, int, float]:
    """Find the first zero of an active guard between the local times s and s + d.

    Return (FOUND, number among the active guards, time since s), (NEVER, -1, d), or OPEN if zeros are not certain.
    """
    tapes, parts, k = model.tapes, own.parts, start.mode_row
    count = tapes.active_start[k + 1] - tapes.active_start[k]
    outcome, g, at = first_guard(
        tapes, k, parts.rows[parts.start[k] : parts.start[k + 1]], model.inputs, own.codes,
        own.search.guard_series.shape[1] - 1, own.control[RTOL], s, d, own.atol, own.polynomial, own.search,
    )  # fmt: skip
    number = -1
    for i in range(count):
        if tapes.active[tapes.active_start[k] + i] == g:
            number = i
    return outcome, number, at


@kernel
def expand_at(model: Any, k: int, s: float, x: Any, own: Any) -> None:
    """Compute Taylor coefficients along the flow from (s, x) with the interpreter of instruction tapes.

    `guards_at_end` calls this kernel if there is no machine code.
    """
    tapes, inputs, W, n = model.tapes, model.inputs, own.search.W, x.shape[0]
    rows = tapes.optimised[tapes.optimised_start[k] : tapes.optimised_start[k + 1]]
    if inputs.time[0] >= 0:
        W[inputs.time[0], 0], W[inputs.time[0], 1] = s, 1.0
    for i in range(n):
        W[inputs.states[i], 0] = x[i]
    for order in range(TERMS):
        call_noinline(advance, (rows, W, order))
        for i in range(n):
            W[inputs.states[i], order + 1] = W[tapes.derivatives[k, i], order] / (order + 1)
    for j in range(tapes.active_start[k + 1] - tapes.active_start[k]):
        for order in range(TERMS):
            own.guards[j, order] = W[own.search.guard_registers[j], order]


@inlined
def guards_at_end(start: Any, model: Any, own: Any, s: float, x: Any) -> None:
    """Write value, slope and half the second derivative of the active guards along the flow to ``own.guards``."""
    code = own.codes.ends[start.mode_row]
    if code != 0:
        call_series(code, s, 0.0, x, own.guards, own.search.W, own.x)
    else:
        expand_at(model, start.mode_row, s, x, own)


@inlined
def record_step(call: Any, work: Any, own: Any, rows: Any, s: float, d: float, end: Any) -> None:
    """Store the step from s to s + d, and copy its end to ``work.y``."""
    row = call.int_slots[STEPS] + own.counts[TAKEN]
    own.counts[TAKEN] += 1
    put(end, work.y)
    rows.steps[row, 0], rows.steps[row, 1] = s, d
    for i in range(work.y.shape[0]):
        call.scale[i] = max(call.scale[i], abs(work.y[i]))
        for j in range(own.polynomial.shape[1]):
            rows.series[row, i, j] = own.polynomial[i, j]


@inlined
def end_segment(
    start: Any, model: Any, call: Any, state: Any, work: Any, own: Any, s: float, length: float, number: int
) -> SegmentEnd:
    """Return the end of a segment at the local time s, with the states in ``work.y``.

    number: of the active guard that is zero there, -1 for none. ``own.guards`` belong to this end if there is one.
    """
    hold_states(model, work, state, s)
    return segment_end(start, model, call, state, work, own, s, length, number)


@inlined
def hold_states(model: Any, work: Any, state: Any, s: float) -> None:
    """Compute the held states in ``work.y`` at the end of a segment from their constraints."""
    if any_holding(model.automata, state.z):
        call_function(called_by(work).project, s, work.y, state.p, state.z, work.x_after)
        put(work.x_after, work.y)


@inlined
def segment_end(
    start: Any, model: Any, call: Any, state: Any, work: Any, own: Any, s: float, length: float, number: int
) -> SegmentEnd:
    """Return the end of a segment as `end_segment` does; the held states are computed already."""
    k, y, taken, fired, slope, bend = start.mode_row, work.y, own.counts[TAKEN], -1, 0.0, 0.0
    if own.codes.ends[k] == 0:
        own.codes.lacked[k] += taken
    call_function(called_by(work).flow, s, y, state.p, state.z, work.slopes)
    error = 2.0 * 2.0**-52 * s
    if number >= 0:
        fired = model.tapes.active[model.tapes.active_start[k] + number]
        value, slope, bend = own.guards[number, 0], own.guards[number, 1], own.guards[number, 2]
        if slope != 0.0 and abs(value / slope) < math.inf:
            error = max(error, abs(value / slope))
    elif s >= start.bound:
        latest = max(abs(call.times[0]), abs(call.times[2]))
        if may_vanish(model, k, s, latest, taken, call.scale, work.slopes, state, work):
            return not_followed(STOPPED)
    return SegmentEnd(FOLLOWED, s, fired, taken, s, error, slope, bend, length, False)
