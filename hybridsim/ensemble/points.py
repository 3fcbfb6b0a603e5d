"""This module begins the run at a point of a group in compiled code, and summarises a part of the run.

The kernels of searches and of runs call both functions by address. Each function is compiled once.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.compiled.known_time import set_origin
from hybridsim.engine.events.compiled.start import plain_start
from hybridsim.engine.linear.motion_summary import sum_up
from hybridsim.engine.native.kernels import inline_always, inlined
from hybridsim.engine.native.loop_hints import fill, put
from hybridsim.engine.native.struct_pack import pack_at
from hybridsim.engine.series.bounded import UNIT
from hybridsim.ensemble.start import keeps_holding

UNDECIDED, MOVES, RESTS = range(3)  # results of `begin_point`
BEGIN, SUMMARISE, SEARCH, NEWTON = range(4)  # indices of `LoopPacks.entry_points`


class LoopPacks(NamedTuple):
    """The arrays of the compiled event loop for one model, packed for kernels."""

    model: Any  # `hybridsim.engine.run.event_loop.LoopModel`, whose tables are those of the present point
    call: Any  # `LoopCall`
    state: Any  # `StateArrays`
    work: Any  # `EventScratch`
    own: Any  # `hybridsim.integrators.closed_form.segments.ClosedFormArrays`
    record: Any  # `LoopRecord`
    rows: Any  # `ClosedFormRows`
    lin_at: np.ndarray  # address (1,) of the tables in `model`
    entry_points: np.ndarray  # addresses (4,) of kernels at BEGIN, SUMMARISE, SEARCH, NEWTON
    slopes: np.ndarray  # (3, n) scratch of `summarise`


class Points(NamedTuple):
    """The m points of a group, as kernels read them."""

    tables: np.ndarray  # addresses (m,) of tables
    vectors: np.ndarray  # run-time vectors (m, P)
    rates: np.ndarray  # rates (m, R, 2) of angles: numbers and rests
    starts: np.ndarray  # initial states (m, n)
    periods: np.ndarray  # forcing periods (m,)
    longest: np.ndarray  # longest segments (m,)


class Fixed(NamedTuple):
    """The data that all points of a system have in common."""

    positions: np.ndarray  # positions (3,) of the origin, the phases and the pin in the run-time vector
    hold: np.ndarray  # holding mode (C,) of each component
    constant: np.ndarray  # this and the next four: see `hybridsim.engine.events.compiled.start.surfaces_of`
    rows: np.ndarray
    derivatives: np.ndarray
    registers: np.ndarray
    owners: np.ndarray
    nodes: np.ndarray  # of the quadrature
    weights: np.ndarray


class PeriodSummary(NamedTuple):
    """The measures of one period at one point; with a leading axis, the measures at several points."""

    extremes: np.ndarray  # (2, n) smallest and largest value of each state
    integrals: np.ndarray  # (2, n) of x and x**2
    ends: np.ndarray  # (2, n) states at the beginning and the end
    held: np.ndarray  # (2, C) time in the holding mode, and number of its intervals, by component
    holding: np.ndarray  # (2, C) whether the component holds at the beginning and at the end
    times: np.ndarray  # (C, modes) time in each mode, by component


def begin_point(packs: Any, none: Any, fixed: Any, points: Any, found: Any, i: int) -> int:
    """Begin the run of point `i`, and return UNDECIDED, MOVES or RESTS.

    The tables of the point are entered in the model. If the state rests, its period is summarised in `found`. none:
    empty tables.
    """
    model, state, work, call, own = packs.model, packs.state, packs.work, packs.call, packs.own
    positions, rates = fixed.positions, points.rates[i]
    surfaces = fixed.constant, fixed.rows, fixed.derivatives, fixed.registers, fixed.owners
    lin = pack_at(
        points.tables[i], model.lin
    )  # the address in the model may be read before this kernel enters it
    packs.lin_at[0] = points.tables[i]
    put(points.starts[i], state.x)
    put(points.vectors[i], state.p)
    set_origin((positions[0], positions[1]), rates, 0.0, 0.0, state.p)
    set_start_errors(state)
    if not plain_start(model.automata, model.tapes, model.inputs, none, positions[2], surfaces, state, work):
        return UNDECIDED
    if keeps_holding(model.tapes, lin, state, work, own.c):
        _take_rest(fixed.hold, points.periods[i], state, found)
        return RESTS
    for r in range(rates.shape[0]):
        put(rates[r], call.rates[r])
    for k in range(own.hints.shape[0]):
        fill(own.hints[k], 0.0)
    call.longest[0] = points.longest[i]
    return MOVES


def summarise(
    packs: Any, fixed: Any, record: Any, rows: Any, found: Any, first: int, last: int, begin: float
) -> int:
    """Write the measures of recorded segments to `found`; return 0 if a segment has too many oscillations.

    The first segment counts from local time `begin` on. record: `LoopRecord`; rows: `ClosedFormRows`.
    """
    scratch = packs.own.v, packs.slopes
    for i in range(found.extremes.shape[1]):
        found.extremes[0, i], found.extremes[1, i] = np.inf, -np.inf
        found.integrals[0, i] = found.integrals[1, i] = 0.0
    for c in range(found.held.shape[1]):
        found.held[0, c] = found.held[1, c] = 0.0
        fill(found.times[c], 0.0)
        for segment in range(first, last):
            found.times[c, record.modes[segment, c]] += rows.ends[segment] - (
                begin if segment == first else 0.0
            )
    segments = rows.ends, rows.rows, record.modes, rows.coordinates, record.jumps
    is_known = sum_up(
        packs.model.lin, fixed.hold, segments, first, last, begin, fixed.nodes, fixed.weights, scratch, found
    )
    return 1 if is_known else 0


@inlined
def set_start_errors(state: Any) -> None:
    """Set the error bounds of start values from their rounding; whole numbers are exact."""
    for j in range(state.x.shape[0]):
        x = state.x[j]
        state.x_error[j] = 0.0 if x == round(x) else 2.0 * UNIT * abs(x)


@inline_always
def _take_rest(hold: Any, period: float, state: Any, found: Any) -> None:
    """Write the measures of a period in which nothing moves."""
    x, z = state.x, state.z
    for i in range(x.shape[0]):
        for side in range(2):
            found.extremes[side, i] = found.ends[side, i] = x[i]
        found.integrals[0, i], found.integrals[1, i] = period * x[i], period * (x[i] * x[i])
    for c in range(z.shape[0]):
        is_held = z[c] == hold[c]
        found.held[0, c], found.held[1, c] = (period, 1.0) if is_held else (0.0, 0.0)
        found.holding[0, c] = found.holding[1, c] = is_held
        fill(found.times[c], 0.0)
        found.times[c, z[c]] = period


@inlined
def store_summary(found: Any, summaries: Any, i: int) -> None:
    """Store the measures of point `i`."""
    for side in range(2):
        put(found.extremes[side], summaries.extremes[i, side])
        put(found.integrals[side], summaries.integrals[i, side])
        put(found.ends[side], summaries.ends[i, side])
        put(found.held[side], summaries.held[i, side])
        put(found.holding[side], summaries.holding[i, side])
    for c in range(found.times.shape[0]):
        put(found.times[c], summaries.times[i, c])


def summaries_of(count: int, states: int, components: int, modes: int) -> PeriodSummary:
    """Return uninitialised measures of several points."""
    return PeriodSummary(
        extremes=np.empty((count, 2, states)),
        integrals=np.empty((count, 2, states)),
        ends=np.empty((count, 2, states)),
        held=np.empty((count, 2, components)),
        holding=np.empty((count, 2, components), dtype=np.bool_),
        times=np.empty((count, components, modes)),
    )
