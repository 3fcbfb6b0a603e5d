"""Resolve the event at the end of a segment in a compiled loop, with error bounds of the state."""

from __future__ import annotations

from typing import Any

from hybridsim.engine.events.compiled.guard_series import link_interpreted_series
from hybridsim.engine.events.compiled.resolve_impact import resolve_impact
from hybridsim.engine.events.compiled.resolve_ordinary import resolve_event
from hybridsim.engine.events.compiled.scratch import AT, AT_ERROR, FIRED, IMPACT, NOBODY, RESOLVE
from hybridsim.engine.events.zeno.accumulation import CLOSING_IN
from hybridsim.engine.native.kernels import call_kernel, inlined, kernel, kernel_address
from hybridsim.engine.native.loop_hints import index, short_loop
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.instant import two_sum

_STEADY = 1e-3  # relative change allowed in the ratio of intervals of an accumulating series
_SHALLOW = 2.0**-18  # least depth below zero, times four, relative to a guard's values on the last step
_HIDDEN = 16.0  # least depth below zero, times four, in rounding errors of the guard
STAGES = 200.0  # the largest `rounding` of a method with a compiled loop
_ULPS = 64.0  # events closer than this are left to the general mode loop
# The same for impacts: an accumulation ends when its rest is 1024 ulps.
_ULPS_OF_IMPACTS = 4096.0
# A series that has shrunk by this factor and breaks off may have ended: ten times the factor of `Accumulation`.
_FAR_DOWN = 1e-5


@kernel
def is_crowded(gap: float, clock: Any, pace: Any, is_impact: bool) -> bool:
    """Return whether events follow each other so fast that a compiled loop has to stop.

    gap: time since the last event. pace (5,): the gap before, its ratio to the one before that, how often that ratio
    was steady, and the longest gap since the gaps began to shrink. Impacts may accumulate in a compiled loop almost up
    to their limit, since `hybridsim.engine.events.compiled.resolve_impact` notices when rounding may hide bounces. The
    loop stops if such a series breaks off.
    """
    ratio = gap / pace[0]
    steady = ratio < CLOSING_IN and abs(ratio - pace[1]) <= _STEADY * ratio
    breaks_off = ratio > 1.0 and pace[0] <= _FAR_DOWN * pace[3]
    pace[3] = gap if ratio > 1.0 else max(pace[3], gap)
    pace[0], pace[1], pace[2] = gap, ratio, pace[2] + 1.0 if steady else 0.0
    ulp = 2.0**-52 * abs(clock[0])
    if is_impact:
        return breaks_off or gap <= _ULPS_OF_IMPACTS * ulp
    return pace[2] > 2.0 or gap <= _ULPS * ulp


@inlined
def state_errors(
    automata: Any, s_error: float, y: Any, scale: Any, x_error: Any, z: Any, slopes: Any, out: Any
) -> None:
    """Write error bounds of the states at an event, from rounding, earlier errors and the event time."""
    for i in range(y.shape[0]):
        short_loop()
        out[i] = 4.0 * UNIT * scale[i] + x_error[i] + s_error * abs(slopes[i])
    for c in range(z.shape[0]):
        if automata.hold[c] >= 0 and z[c] == automata.hold[c]:
            for j in range(automata.pin.shape[1]):
                short_loop()
                i = automata.pin[c, j]
                if i >= 0:
                    out[index(i)] = UNIT * abs(y[index(i)])


@inlined
def spread(steps: int, rounding: float) -> float:
    """Return the factor by which rounding over several steps enlarges the error bounds of guards."""
    return 1.0 + 12.0 * steps + 0.5 * rounding


@inlined
def is_shallow(slope: float, bend: float, length: float) -> bool:
    """Return whether a guard with a located zero rises again so soon that it may only touch zero.

    slope, bend: its first and second Taylor coefficient there. length: of the step before, which gives its size.
    `is_hidden` decides then.
    """
    return bend > 0.0 and slope * slope < _SHALLOW * bend * length * (abs(slope) + bend * length)


@inlined
def resolve(model: Any, s: float, s_error: float, fired: int, state: Any, work: Any) -> bool:
    """Resolve an ordinary event at the state in the work space; return False for other events.

    model: `LoopModel`. state: `StateArrays`, replaced by the state after the event.
    """
    work.float_slots[AT], work.float_slots[AT_ERROR], work.int_slots[FIRED] = s, s_error, fired
    arguments = (model.automata, model.tapes, model.inputs, model.lin, state, work)
    return call_kernel(work.entry_points[RESOLVE], arguments) != 0


@inlined
def fill_guard_series(model: Any, s: float, s_error: float, state: Any, work: Any) -> None:
    """Write the Taylor series of the active guards and their bounds to the array `judged` of the work space."""
    resolve(model, s, s_error, NOBODY, state, work)


@inlined
def is_hidden(
    model: Any, g: int, slope: float, bend: float, s: float, s_error: float, state: Any, work: Any
) -> bool:
    """Return whether a guard turns and rises again before its size exceeds its rounding error.

    The state is that in the work space, at local time s.
    """
    fill_guard_series(model, s, s_error, state, work)
    return slope * slope < _HIDDEN * bend * work.judged[1, g, 0]


@kernel
def differ_by_rounding(model: Any, k: int, s: float, values: Any, sums: Any, state: Any, work: Any) -> bool:
    """Return whether the values of active guards agree with the sums of their series within rounding.

    A guard may be the small difference of large terms, and then shorter steps do not improve the agreement. k: row of
    the modes. y of the work space is the state from which the series are computed, at local time s.
    """
    tapes = model.tapes
    for i in range(work.y.shape[0]):
        work.y_error[i] = 4.0 * UNIT * abs(work.y[i])
    fill_guard_series(model, s, 0.0, state, work)
    for j in range(values.shape[0]):
        rounding = work.judged[1, tapes.active[tapes.active_start[k] + j], 0]
        if not abs(sums[j] - values[j]) <= 4.0 * rounding:
            return False
    return True


@inlined
def moved_on(high: float, low: float, s: float) -> tuple[float, float]:
    """Return the sum of the instant (high, low) and the time s."""
    high, rest = two_sum(high, s)
    return two_sum(high, rest + low)


def link_event_resolution(model: Any, state: Any, work: Any) -> None:
    """Compile the kernel that resolves events, and store the addresses of all kernels that it calls."""
    automata, tapes, inputs, lin = model.automata, model.tapes, model.inputs, model.lin
    link_interpreted_series(tapes, inputs, state, work)
    if automata.is_unilateral.any():
        work.entry_points[IMPACT] = kernel_address(
            resolve_impact, automata, tapes, inputs, lin, state, work, 0
        )
    work.entry_points[RESOLVE] = kernel_address(resolve_event, automata, tapes, inputs, lin, state, work)
