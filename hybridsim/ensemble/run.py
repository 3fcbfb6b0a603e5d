"""The runs of a fleet, one after the other in compiled code: each from its start to the sums over its last period."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.compiled.scratch import LEAP
from hybridsim.engine.linear.stretch import sum_up
from hybridsim.engine.native.kernels import call_kernel, inlined, kernel
from hybridsim.engine.native.loop_hints import fill, put
from hybridsim.engine.native.struct_pack import pack_at
from hybridsim.engine.run.leap import AT_TARGET, FULL
from hybridsim.engine.system.instant import two_sum
from hybridsim.ensemble.start import plain_start, rests_for_ever

SEGMENTS = 1024  # room for one leap
# Where events follow each other ever faster a leap ends, for others to see whether they accumulate. A few intervals
# that shrink by one factor are none of that yet: the run goes on, so often at most.
_RESUMED = 4
_AT_ONCE = 8192  # segments, about: some milliseconds, after which whoever waits is asked
NEXT, BEGUN, KEPT, RESUMED = range(4)  # of `Runs.at`


class Runs(NamedTuple):
    """What is to be run: addresses of tables (m,), vectors (m, P), rates (m, R), starts (m, n); ends, periods and the
    longest segments (m,). What is found: done (m,), and as in `hybridsim.engine.linear.stretch.Stretch` of each. at
    (4,): the run that is under way, whether it has begun, segments kept, and how often it was resumed.
    """

    tables: np.ndarray
    vectors: np.ndarray
    rates: np.ndarray
    starts: np.ndarray
    ends: np.ndarray
    periods: np.ndarray
    longest: np.ndarray
    done: np.ndarray
    extremes: np.ndarray
    integrals: np.ndarray
    sides: np.ndarray
    held: np.ndarray
    holding: np.ndarray
    at: np.ndarray


@kernel
def run_fleet(
    automata: Any,
    tapes: Any,
    inputs: Any,
    none: Any,
    lin: Any,
    places: Any,
    surfaces: Any,
    hold: Any,
    rule: Any,
    runs: Any,
    slopes: Any,
    state: Any,
    work: Any,
    room: Any,
    late: Any,
    record: Any,
    found: Any,
) -> None:
    """Run one after the other, from the one under way on, until all are done or some milliseconds have passed.

    lin: tables of the type of all. places: where in p the origin, the phases and the pin are. hold: mode of each
    component. rule: nodes and weights; slopes (3, n): room for `sum_up`.
    record: room for twice as many segments as a leap has, late: its second half.
    """
    origin_at, phases_at, pin_at = places
    at, clock, target = runs.at, room.times[2:], room.times[:2]
    segments = 0
    while at[NEXT] < runs.ends.shape[0] and segments < _AT_ONCE:
        i = at[NEXT]
        tables, rates = pack_at(runs.tables[i], lin), runs.rates[i]
        if at[BEGUN] == 0:
            put(runs.starts[i], state.x)
            put(runs.vectors[i], state.p)
            segments += 1
            if not plain_start(
                automata, tapes, inputs, none, (rates, origin_at, phases_at, pin_at), surfaces, 0.0, state,
                work,
            ):  # fmt: skip
                at[NEXT] += 1
                continue
            if rests_for_ever(tapes, tables, state, work, room.c):
                _take_rest(hold, runs.periods[i], state, found)
                _keep(found, runs, i)
                at[NEXT] += 1
                continue
            put(rates, room.rates)
            for k in range(room.hints.shape[0]):
                fill(room.hints[k], 0.0)
            clock[0], clock[1], target[0], target[1] = 0.0, 0.0, runs.ends[i], 0.0
            room.longest[0] = runs.longest[i]
            at[BEGUN], at[KEPT], at[RESUMED] = 1, 0, 0
        code = call_kernel(work.reached[LEAP], (automata, tapes, inputs, tables, state, work, room, late))
        count = room.committed[0]
        segments += count if code != FULL else _AT_ONCE
        if code == AT_TARGET:
            first, begin = _begin(record, at[KEPT], count, runs.ends[i] - runs.periods[i])
            if first >= 0:
                _clear(found)
                if sum_up(
                    tables, hold, (record.ends, record.rows, record.modes, record.coordinates, record.jumps),
                    first, SEGMENTS + count, begin, rule[0], rule[1], (room.v, slopes), found,
                ):  # fmt: skip
                    _keep(found, runs, i)
            count = 0
        elif count > 0:
            at[RESUMED] += 0 if code == FULL else 1
            at[KEPT] = min(at[KEPT] + count, SEGMENTS)
            _make_room(record, at[KEPT], count)
        if count == 0 or at[RESUMED] > _RESUMED:
            at[NEXT] += 1
            at[BEGUN] = 0


@inlined
def _begin(record: Any, kept: int, count: int, since: float) -> tuple[int, float]:
    """The segment in which an instant lies, and when in it; -1 if it is before all of them."""
    first = SEGMENTS + count - 1
    while first >= SEGMENTS - kept:
        high, low = record.clocks[first, 0], record.clocks[first, 1]
        if (high - since) + low <= 0.0:
            high, error = two_sum(since, -high)
            return first, high + (error - low)
        first -= 1
    return -1, 0.0


@inlined
def _make_room(record: Any, kept: int, count: int) -> None:
    """Leave the last segments before the second half of a record, which is free again."""
    for i in range(SEGMENTS - kept, SEGMENTS):
        record.ends[i], record.rows[i] = record.ends[i + count], record.rows[i + count]
        put(record.clocks[i + count], record.clocks[i])
        put(record.modes[i + count], record.modes[i])
        put(record.coordinates[i + count], record.coordinates[i])
        for side in range(record.jumps.shape[1]):
            put(record.jumps[i + count, side], record.jumps[i, side])


@inlined
def _clear(found: Any) -> None:
    for i in range(found.extremes.shape[1]):
        found.extremes[0, i], found.extremes[1, i] = np.inf, -np.inf
        found.integrals[0, i] = found.integrals[1, i] = 0.0
    for c in range(found.held.shape[1]):
        found.held[0, c] = found.held[1, c] = 0.0


@inlined
def _take_rest(hold: Any, period: float, state: Any, found: Any) -> None:
    """What a period holds in which nothing moves."""
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
def _keep(found: Any, runs: Any, i: int) -> None:
    runs.done[i] = True
    for side in range(2):
        put(found.extremes[side], runs.extremes[i, side])
        put(found.integrals[side], runs.integrals[i, side])
        put(found.ends[side], runs.sides[i, side])
        put(found.held[side], runs.held[i, side])
        put(found.holding[side], runs.holding[i, side])
