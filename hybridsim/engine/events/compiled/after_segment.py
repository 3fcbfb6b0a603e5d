"""Where a compiled loop ends a segment: what is known of the state there, the event settled, the next origin."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.compiled.resolve_ordinary import settle_event
from hybridsim.engine.events.compiled.scratch import AT, AT_ERROR, FIRED, NOBODY, SERIES, SETTLE, SPREAD
from hybridsim.engine.events.compiled.verdicts import interpreted_series
from hybridsim.engine.events.zeno.accumulation import CLOSING_IN
from hybridsim.engine.native.kernels import call_kernel, inlined, kernel, kernel_address
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.instant import two_sum

_STEADY = 1e-3  # of the ratio of intervals between events: what it may change by in a series that accumulates
_SHALLOW = 2.0**-18  # of a guard's values on the last step: how far below zero it goes, times four, at least
_HIDDEN = 16.0  # four times its rounding, at least
STAGES = 200.0  # the largest `rounding` of a method with a compiled loop
_ULPS = 64.0  # events closer than this are for the general way to tell apart


class State(NamedTuple):
    """What holds at the start of a segment: x, x_error (n,), z (C,), p, and sides, orders, floors (G,) of guards."""

    x: np.ndarray
    x_error: np.ndarray
    z: np.ndarray
    p: np.ndarray
    sides: np.ndarray
    orders: np.ndarray
    floors: np.ndarray


@kernel
def is_crowded(gap: float, clock: Any, pace: Any) -> bool:
    """Whether events follow each other so closely, or ever faster, that it is not for a compiled loop to go on.

    gap: since the last event. pace (3,): the gap before, its ratio to the one before that, how often it was steady.
    """
    ratio = gap / pace[0]
    steady = ratio < CLOSING_IN and abs(ratio - pace[1]) <= _STEADY * ratio
    pace[0], pace[1], pace[2] = gap, ratio, pace[2] + 1.0 if steady else 0.0
    return pace[2] > 2.0 or gap <= _ULPS * 2.0**-52 * abs(clock[0])


@inlined
def state_errors(
    automata: Any, s_error: float, y: Any, scale: Any, x_error: Any, z: Any, slopes: Any, out: Any
) -> None:
    """Bounds of the states at an event: rounding on the segment (of sizes `scale`), what was left, the instant's."""
    for i in range(y.shape[0]):
        out[i] = 4.0 * UNIT * scale[i] + x_error[i] + s_error * abs(slopes[i])
    for c in range(z.shape[0]):
        if automata.hold[c] >= 0 and z[c] == automata.hold[c]:
            for j in range(automata.pin.shape[1]):
                i = automata.pin[c, j]
                if i >= 0:
                    out[i] = UNIT * abs(y[i])


@inlined
def spread(steps: int, rounding: float) -> float:
    """How many of its bounds a guard may be from zero by what steps round away: see `engine.run.located.add_steps`."""
    return 1.0 + 12.0 * steps + 0.5 * rounding


@inlined
def is_shallow(slope: float, bend: float, length: float) -> bool:
    """Whether a guard that was located at zero turns back so soon that it may do no more than touch it.

    slope, bend: its first and second coefficient there; length: of the step before, over which they say how large it
    was. Then `is_hidden` has the last word.
    """
    return bend > 0.0 and slope * slope < _SHALLOW * bend * length * (abs(slope) + bend * length)


@inlined
def judge(
    automata: Any, tapes: Any, inputs: Any, lin: Any, s: float, s_error: float, state: Any, work: Any
) -> None:
    """Series of the active guards with bounds, to `judged` of the work space, at the state y, y_error there."""
    work.real[AT], work.real[AT_ERROR], work.whole[FIRED] = s, s_error, NOBODY
    call_kernel(work.reached[SETTLE], (automata, tapes, inputs, lin, state, work))


@inlined
def is_hidden(
    automata: Any,
    tapes: Any,
    inputs: Any,
    lin: Any,
    g: int,
    slope: float,
    bend: float,
    s: float,
    s_error: float,
    state: Any,
    work: Any,
) -> bool:
    """Whether a guard comes back before it is beyond the rounding of all that its expression is made of.

    At the state in the work space, at local time s.
    """
    judge(automata, tapes, inputs, lin, s, s_error, state, work)
    return slope * slope < _HIDDEN * bend * work.judged[1, g, 0]


@kernel
def differ_by_rounding(
    automata: Any,
    tapes: Any,
    inputs: Any,
    lin: Any,
    k: int,
    s: float,
    values: Any,
    sums: Any,
    state: Any,
    work: Any,
) -> bool:
    """Whether values of the active guards and the sums of their series differ by no more than rounding.

    A guard may be the small difference of large terms, which no shorter step makes agree better. Row k is that of the
    modes; y of the work space is the state from which the series are taken, at local time s.
    """
    for i in range(work.y.shape[0]):
        work.y_error[i] = 4.0 * UNIT * abs(work.y[i])
    judge(automata, tapes, inputs, lin, s, 0.0, state, work)
    for j in range(values.shape[0]):
        rounding = work.judged[1, tapes.active[tapes.active_start[k] + j], 0]
        if not abs(sums[j] - values[j]) <= 4.0 * rounding:
            return False
    return True


@inlined
def moved_on(high: float, low: float, s: float) -> tuple[float, float]:
    """An instant and a time after it."""
    high, rest = two_sum(high, s)
    return two_sum(high, rest + low)


def reach_settling(automata: Any, tapes: Any, inputs: Any, lin: Any, state: Any, work: Any) -> None:
    """Compile the kernel that settles events and those it reaches, if need be; put addresses where loops find them."""
    x = work.y
    work.reached[SERIES] = kernel_address(interpreted_series, tapes, inputs, 0, 0.0, 0.0, x, x, state.p, work)
    work.reached[SETTLE] = kernel_address(settle_event, automata, tapes, inputs, lin, state, work)


@inlined
def settle_and_move_on(
    automata: Any,
    tapes: Any,
    inputs: Any,
    lin: Any,
    s: float,
    s_error: float,
    fired: int,
    steps: int,
    clock: Any,
    state: Any,
    work: Any,
) -> bool:
    """Settle an ordinary event and make what follows it the start of the next segment; False leaves all as it was.

    y, y_error of the work space are the state at the event, to which so many steps led. lin: tables of linear modes,
    empty for others. state: `State`, moved on with the clock.
    """
    work.real[AT], work.real[AT_ERROR], work.whole[FIRED] = s, s_error, fired
    work.real[SPREAD] = spread(steps, STAGES)
    if call_kernel(work.reached[SETTLE], (automata, tapes, inputs, lin, state, work)) == 0:
        return False
    clock[0], clock[1] = moved_on(clock[0], clock[1], s)
    return True
