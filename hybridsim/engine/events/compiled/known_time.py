"""Process a known time in a compiled loop: update the inputs, and reset discrete states.

The rules are those of `hybridsim.engine.events.resolve`. A known time is ordinary if all guards of the present modes
are certainly positive just after it. Otherwise nothing is changed, and the general loop resolves it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.compiled.after_segment import STAGES
from hybridsim.engine.events.compiled.guard_series import guard_series
from hybridsim.engine.events.compiled.resolve_surface import take_fine_row
from hybridsim.engine.events.compiled.scratch import (
    DISCRETE,
    DISCRETE_AT,
    LACKS_TAPE,
    LocatedEvent,
    called_by,
)
from hybridsim.engine.linear.guard_coefficients import has_tables, measure_point
from hybridsim.engine.linear.motion import errors_of_time, functions_of_time
from hybridsim.engine.native.kernels import call, inlined
from hybridsim.engine.native.loop_hints import put, short_loop
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.series.layout import SIGNAL_SLOTS
from hybridsim.engine.system.instant import phase_of, two_sum
from hybridsim.engine.system.known_times import MAX_KINDS, MAX_KNOWN_TIMES, START, KnownTimes
from hybridsim.engine.system.system import System

# Indices of the integers of a loop, `LoopCall.int_slots`: three of them count committed steps and segments and known
# times that were passed; the last says whether a call goes on with these.
ORIGIN_AT, PHASES_AT, SIGNALS_AT, STEPS, SEGMENTS, KNOWN, IS_CONTINUED = range(7)
SINCE = 4  # index of `LoopCall.pace`
NO_RESET = -1


class KnownTimeArrays(NamedTuple):
    """The known times that a call of a compiled loop has to process; the last one, of kind -1, ends the call."""

    times: np.ndarray  # (K, 2) instants (high, low)
    kinds: np.ndarray  # (K,) rows of `resets`
    # (K, S, 6) pieces of the inputs up to each time: 4 coefficients, and the start or (nan, 0)
    polynomials: np.ndarray
    starts: np.ndarray  # (S, 2) starts of the present pieces
    resets: np.ndarray  # numbers of the resets of each kind, ended by NO_RESET


def has_known_times(system: System) -> bool:
    """Return whether a model has times that are known before a run: it has inputs or schedules."""
    return bool(system.signals or system.model.schedules)


def known_time_arrays(system: System) -> Any:
    """Return packed arrays for the known times of one call; a model without known times needs only the call's end."""
    most = MAX_KNOWN_TIMES + 1 if has_known_times(system) else 1
    return packed(
        KnownTimeArrays(
            times=np.zeros((most, 2)),
            kinds=np.full(most, -1, dtype=np.int64),
            polynomials=np.zeros((most, len(system.signals), 6)),
            starts=np.zeros((len(system.signals), 2)),
            resets=np.full((MAX_KINDS, len(system.model.schedules) + 1), -1, dtype=np.int64),
        )
    )


def store_known_times(arrays: Any, known: KnownTimes, resets: np.ndarray) -> None:
    """Write the known times that a call has to process to its arrays, followed by the time at which the call ends."""
    m = len(known.kinds)
    arrays.times[:m], arrays.times[m] = known.instants, known.target
    arrays.kinds[:m], arrays.kinds[m] = known.kinds, -1
    arrays.polynomials[: m + 1], arrays.starts[:] = known.polynomials, known.polynomials[0, :, START:]
    arrays.resets[:] = resets


@inlined
def begin_call(ints: Any, pace: Any, work: Any) -> None:
    """Prepare the counters of a call; they continue from the last call if IS_CONTINUED is set."""
    if ints[IS_CONTINUED] == 0:
        pace[0], pace[1], pace[2], pace[3], pace[SINCE] = math.inf, math.inf, 0.0, 0.0, 0.0
        ints[STEPS] = ints[SEGMENTS] = ints[KNOWN] = 0
    ints[IS_CONTINUED] = work.int_slots[LACKS_TAPE] = 0


@inlined
def set_origin(place: Any, rates: Any, hi: float, lo: float, p: Any) -> None:
    """Set the run-time vector for a segment that starts at a given instant; the inputs stay unchanged."""
    origin_at, phases_at = place
    p[origin_at] = hi + lo
    for i in range(rates.shape[0]):
        p[phases_at + i] = phase_of(hi, lo, rates[i, 0], rates[i, 1] * hi)


@inlined
def set_inputs(signals_at: int, starts: Any, hi: float, lo: float, p: Any) -> None:
    """Set the times at which the inputs' intervals start, for a segment that starts at a given instant."""
    for k in range(starts.shape[0]):
        short_loop()
        if starts[k, 0] == starts[k, 0]:
            high, error = two_sum(starts[k, 0], -hi)
            p[signals_at + SIGNAL_SLOTS * k + START] = high + (error + (starts[k, 1] - lo))


@inlined
def errors_at_known_time(model: Any, loop: Any, s: float, steps: int, state: Any, work: Any) -> None:
    """Compute error bounds of the states at a known time, as `errors_when_due` does in Python."""
    functions, automata, p, z = called_by(work), model.automata, state.p, state.z
    y, out, other, slopes = work.y, work.y_error, work.x_after, work.slopes
    ulp, is_holding = 2.0**-52 * abs(loop.times[0]), False
    call(functions.flow, s, y, p, z, slopes)
    for i in range(y.shape[0]):
        way = abs(y[i] - state.x[i])
        stepped = UNIT * ((4.0 + 16.0 * steps) * loop.scale[i] + STAGES * way)
        out[i] = state.x_error[i] + stepped + ulp * abs(slopes[i])
    for c in range(z.shape[0]):
        is_holding = is_holding or (automata.hold[c] >= 0 and z[c] == automata.hold[c])
    if not is_holding:
        return
    call(functions.project, s - 2.0 * ulp, y, p, z, other)
    call(functions.project, s + 2.0 * ulp, y, p, z, slopes)
    for c in range(z.shape[0]):
        if automata.hold[c] >= 0 and z[c] == automata.hold[c]:
            for j in range(automata.pin.shape[1]):
                i = automata.pin[c, j]
                if i >= 0:
                    out[i] = UNIT * abs(y[i]) + abs(slopes[i] - other[i])


@inlined
def apply_resets(loop: Any, kind: int, state: Any, work: Any) -> bool:
    """Write the discrete states after the resets of a known time to p_after; return False if a state is not finite.

    All resets read the values before, with the inputs after the known time. They set different discrete states.
    """
    resets, functions, p, z = loop.known.resets, called_by(work), work.p_after, state.z
    out, asked, n, count = work.out, work.asked, work.y.shape[0], z.shape[0]
    discrete, at = work.int_slots[DISCRETE], work.int_slots[DISCRETE_AT]
    put(work.y, out)
    for i in range(discrete):
        out[n + i] = p[at + i]
    put(z, asked)
    for r in range(resets.shape[1]):
        if resets[kind, r] == NO_RESET:
            break
        asked[count] = resets[kind, r]
        call(functions.reset, 0.0, work.y, p, asked, out)
    for i in range(discrete):
        p[at + i] = out[n + i]
        if not math.isfinite(out[n + i]):
            return False
    return True


@inlined
def needs_choice(automata: Any, z: Any, has_resets: bool) -> bool:
    """Return whether modes have to be chosen after a known time even if the present modes stay admissible.

    An input may strike a closed gap, and after a reset another motion beside a sliding one may be possible.
    """
    for c in range(z.shape[0]):
        is_holding = automata.hold[c] >= 0 and z[c] == automata.hold[c]
        if is_holding and (automata.is_unilateral[c] or (has_resets and automata.is_unique[c])):
            return True
    return False


def resolve_known_time(model: Any, loop: Any, state: Any, work: Any, k: int, s: float, steps: int) -> int:
    """Resolve the next known time and replace the state; return 1, or 0 if the general loop has to resolve the time.

    k: row of the modes. s, steps: local time, and number of steps, of the segment that ends there, at the states in the
    work space.
    """
    automata, tapes, inputs = model.automata, model.tapes, model.inputs
    lin, ints, known = model.lin, loop.int_slots, loop.known
    j, hi, lo, z, p = ints[KNOWN], loop.times[0], loop.times[1], state.z, work.p_after
    if needs_choice(automata, z, known.resets[known.kinds[j], 0] != NO_RESET):
        return 0
    errors_at_known_time(model, loop, s, steps, state, work)
    put(state.p, p)
    set_origin((ints[ORIGIN_AT], ints[PHASES_AT]), loop.rates, hi, lo, p)
    polynomials = known.polynomials[j + 1]
    for i in range(polynomials.shape[0]):
        for m in range(START):
            p[ints[SIGNALS_AT] + SIGNAL_SLOTS * i + m] = polynomials[i, m]
    set_inputs(ints[SIGNALS_AT], polynomials[:, START:], hi, lo, p)
    if not apply_resets(loop, known.kinds[j], state, work):
        return 0
    x, x_error = work.x_after, work.slopes
    put(work.y, x)
    put(work.y_error, x_error)
    for c in range(z.shape[0]):
        work.now[c] = work.before[c] = z[c]
        work.on_surface[c] = False
    if has_tables(lin):
        functions_of_time(lin, 0.0, p, work.factors, work.w)
        errors_of_time(lin, 0.0, work.factors, work.w_error)
        measure_point(lin, work)
    guard_series(tapes, inputs, lin, k, LocatedEvent(0.0, 0.0, x, x_error, p, z), x, x_error, work)
    if not take_fine_row(automata, lin, k, z, True, state, work):
        return 0
    put(x, state.x)
    put(x_error, state.x_error)
    put(p, state.p)
    for i in range(polynomials.shape[0]):
        known.starts[i, 0], known.starts[i, 1] = polynomials[i, START], polynomials[i, START + 1]
    return 1
