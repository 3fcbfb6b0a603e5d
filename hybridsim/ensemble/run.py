"""This module runs many parameter points in compiled code, and measures the last period of each run."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.compiled.known_time import SEGMENTS as SEGMENTS_AT
from hybridsim.engine.events.compiled.known_time import set_origin
from hybridsim.engine.events.compiled.scratch import EVENT_LOOP
from hybridsim.engine.events.compiled.start import plain_start
from hybridsim.engine.linear.motion_summary import sum_up
from hybridsim.engine.native.kernels import call_kernel, inlined, kernel
from hybridsim.engine.native.loop_hints import fill, put
from hybridsim.engine.native.struct_pack import pack_at
from hybridsim.engine.run.event_loop import AT_TARGET, FULL
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.instant import two_sum
from hybridsim.ensemble.start import keeps_holding

SEGMENTS = 1024  # largest number of segments in one compiled call
# A compiled call ends if events follow each other ever faster, because they may accumulate. A few shrinking intervals
# are not an accumulation, so the run is resumed up to this many times.
_MAX_RESUMPTIONS = 4
_SEGMENTS_PER_CHECK = 8192  # between checks for interruption: some milliseconds
NEXT, BEGUN, STORED, RESUMED = range(4)  # indices of `Runs.at`


class Runs(NamedTuple):
    """The m runs of a group, with their results."""

    tables: np.ndarray  # addresses (m,) of tables; the present one is put into the table of the model's pack
    vectors: np.ndarray  # run-time vectors (m, P)
    rates: np.ndarray  # rates (m, R) of angles
    starts: np.ndarray  # initial states (m, n)
    ends: np.ndarray  # end times (m,)
    periods: np.ndarray  # periods (m,)
    longest: np.ndarray  # longest segments (m,)
    done: np.ndarray  # whether each run (m,) is finished
    extremes: np.ndarray  # results of each run as in `hybridsim.engine.linear.motion_summary.MotionSummary`
    integrals: np.ndarray
    sides: np.ndarray
    held: np.ndarray
    holding: np.ndarray
    at: np.ndarray  # (4,): current run, whether it has begun, segments kept, number of resumptions


@kernel
def run_ensemble(
    model: Any,
    lin_at: Any,
    none: Any,
    vector_positions: Any,
    surfaces: Any,
    hold: Any,
    rule: Any,
    runs: Any,
    slopes: Any,
    state: Any,
    work: Any,
    loop: Any,
    own: Any,
    late: Any,
    record: Any,
    found: Any,
) -> None:
    """Run the points of a group in order, until all are done or a number of segments is computed.

    model: `LoopModel` with tables of the common type; lin_at (1,): their address in it, which each run changes. none:
    empty tables. vector_positions: positions of the origin, the phases and the pin in p. hold: holding mode of each
    component. rule: nodes and weights. slopes (3, n): scratch for `sum_up`. record: `LoopRecord` and `ClosedFormRows`
    of twice as many segments as one compiled call has. late: the last arguments of `event_loop`, with their second
    half.
    """
    automata, tapes, inputs = model.automata, model.tapes, model.inputs
    origin_at, phases_at, pin_at = vector_positions
    at, clock, target = runs.at, loop.times[2:], loop.times[:2]
    common, rows = record
    segments = 0
    while at[NEXT] < runs.ends.shape[0] and segments < _SEGMENTS_PER_CHECK:
        i = at[NEXT]
        tables, rates = pack_at(runs.tables[i], model.lin), runs.rates[i]
        if at[BEGUN] == 0:
            put(runs.starts[i], state.x)
            put(runs.vectors[i], state.p)
            segments += 1
            set_origin((origin_at, phases_at), rates, 0.0, 0.0, state.p)
            for j in range(state.x.shape[0]):  # as `hybridsim.engine.events.start.start_errors`
                x = state.x[j]
                state.x_error[j] = 0.0 if x == round(x) else 2.0 * UNIT * abs(x)
            if not plain_start(automata, tapes, inputs, none, pin_at, surfaces, state, work):
                at[NEXT] += 1
                continue
            if keeps_holding(tapes, tables, state, work, own.c):
                take_rest(hold, runs.periods[i], state, found)
                store_summary(found, runs, i)
                runs.done[i] = True
                at[NEXT] += 1
                continue
            put(rates, loop.rates)
            for k in range(own.hints.shape[0]):
                fill(own.hints[k], 0.0)
            clock[0], clock[1], target[0], target[1] = 0.0, 0.0, runs.ends[i], 0.0
            loop.longest[0] = runs.longest[i]
            at[BEGUN], at[STORED], at[RESUMED] = 1, 0, 0
        lin_at[0] = runs.tables[i]
        code = call_kernel(
            work.entry_points[EVENT_LOOP], (model, loop, state, work, late[0], late[1], late[2])
        )
        count = loop.int_slots[SEGMENTS_AT]
        segments += count if code != FULL else _SEGMENTS_PER_CHECK
        if code == AT_TARGET:
            first, begin = _begin(common, at[STORED], count, runs.ends[i] - runs.periods[i])
            if first >= 0:
                clear_summary(found)
                if sum_up(
                    tables, hold, (rows.ends, rows.rows, common.modes, rows.coordinates, common.jumps),
                    first, SEGMENTS + count, begin, rule[0], rule[1], (own.v, slopes), found,
                ):  # fmt: skip
                    store_summary(found, runs, i)
                    runs.done[i] = True
            count = 0
        elif count > 0:
            at[RESUMED] += 0 if code == FULL else 1
            at[STORED] = min(at[STORED] + count, SEGMENTS)
            _shift_back(common, rows, at[STORED], count)
        if count == 0 or at[RESUMED] > _MAX_RESUMPTIONS:
            at[NEXT] += 1
            at[BEGUN] = 0


@inlined
def _begin(record: Any, stored: int, count: int, since: float) -> tuple[int, float]:
    """Return the segment that contains an instant, and the local time, or -1 if no segment contains the instant."""
    first = SEGMENTS + count - 1
    while first >= SEGMENTS - stored:
        high, low = record.clocks[first, 0], record.clocks[first, 1]
        if (high - since) + low <= 0.0:
            high, error = two_sum(since, -high)
            return first, high + (error - low)
        first -= 1
    return -1, 0.0


@inlined
def _shift_back(record: Any, rows: Any, stored: int, count: int) -> None:
    """Move the later half of the segments to the start of a record, to make room for new segments."""
    for i in range(SEGMENTS - stored, SEGMENTS):
        rows.ends[i], rows.rows[i] = rows.ends[i + count], rows.rows[i + count]
        put(record.clocks[i + count], record.clocks[i])
        put(record.modes[i + count], record.modes[i])
        put(rows.coordinates[i + count], rows.coordinates[i])
        for side in range(record.jumps.shape[1]):
            put(record.jumps[i + count, side], record.jumps[i, side])


@inlined
def clear_summary(found: Any) -> None:
    """Set a `MotionSummary` to its values before any motion."""
    for i in range(found.extremes.shape[1]):
        found.extremes[0, i], found.extremes[1, i] = np.inf, -np.inf
        found.integrals[0, i] = found.integrals[1, i] = 0.0
    for c in range(found.held.shape[1]):
        found.held[0, c] = found.held[1, c] = 0.0


@inlined
def take_rest(hold: Any, period: float, state: Any, found: Any) -> None:
    """Write the results of a last period in which nothing moves."""
    x, z = state.x, state.z
    for i in range(x.shape[0]):
        for side in range(2):
            found.extremes[side, i] = found.ends[side, i] = x[i]
        found.integrals[0, i], found.integrals[1, i] = period * x[i], period * (x[i] * x[i])
    for c in range(z.shape[0]):
        is_held = z[c] == hold[c]
        found.held[0, c], found.held[1, c] = (period, 1.0) if is_held else (0.0, 0.0)
        found.holding[0, c] = found.holding[1, c] = is_held


@inlined
def store_summary(found: Any, runs: Any, i: int) -> None:
    """Store a `MotionSummary` as the summary of run `i`."""
    for side in range(2):
        put(found.extremes[side], runs.extremes[i, side])
        put(found.integrals[side], runs.integrals[i, side])
        put(found.ends[side], runs.sides[i, side])
        put(found.held[side], runs.held[i, side])
        put(found.holding[side], runs.holding[i, side])
