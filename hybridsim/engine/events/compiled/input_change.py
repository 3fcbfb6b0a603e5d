"""This module changes held inputs in compiled code, if all modes certainly stay admissible.

The rules are those of `hybridsim.engine.events.resolve`, which resolves the other cases.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.choice.verdict import NO_SIDE
from hybridsim.engine.events.compiled.guard_series import guard_series
from hybridsim.engine.events.compiled.resolve_surface import take_fine_row
from hybridsim.engine.events.compiled.scratch import LocatedEvent, row_of
from hybridsim.engine.events.compiled.start import StartScratch, judged
from hybridsim.engine.events.state import HybridState
from hybridsim.engine.native.kernels import ENABLED, Precompiled, inline_always, kernel
from hybridsim.engine.native.loop_hints import put
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.series.bounded import run_series
from hybridsim.engine.series.optimise import live_rows
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.per_structure import per_structure
from hybridsim.engine.system.system import System

_LEAST = math.ulp(0.0)  # error of the time of zeros at an instant without an event


class SurfaceTape(NamedTuple):
    """The instruction tape of those surfaces that read discrete states, in one combination of modes."""

    constant: np.ndarray  # rows executed once per segment
    rows: np.ndarray
    derivatives: np.ndarray  # registers of the rates
    surfaces: np.ndarray  # registers of these surfaces


@inline_always
def _surfaces_stay(inputs: Any, tape: Any, pin_at: int, former: Any, state: Any, work: Any) -> bool:
    """Return whether the surfaces of the tape have the same values before and after a change of the run-time vector."""
    V, E, exact, values = work.V, work.E, work.y_error, work.jumps
    count = tape.surfaces.shape[0]
    for i in range(exact.shape[0]):
        exact[i] = 0.0
    former[pin_at] = state.p[pin_at] = 0.0  # the states as they are, not projected by a holding mode
    run_series(tape.constant, tape.rows, inputs, tape.derivatives, 0.0, 0.0, state.x, exact, former, V, E)
    for j in range(count):
        values[j], values[count + j] = V[tape.surfaces[j], 0], E[tape.surfaces[j], 0]
    run_series(tape.constant, tape.rows, inputs, tape.derivatives, 0.0, 0.0, state.x, exact, state.p, V, E)
    former[pin_at] = state.p[pin_at] = 1.0
    for j in range(count):
        r = tape.surfaces[j]
        if not abs(V[r, 0] - values[j]) <= values[count + j] + E[r, 0]:
            return False
    return True


@kernel
def admit_modes(
    automata: Any,
    tapes: Any,
    inputs: Any,
    none: Any,
    tape: Any,
    pin_at: int,
    former: Any,
    state: Any,
    work: Any,
) -> bool:
    """Return whether the modes in `state` certainly stay admissible when the run-time vector of `state` changes.

    none: empty tables, so that guards are judged by the tape. tape: `SurfaceTape` of the modes. pin_at: position of
    the pin in p. former: the run-time vector before the change.
    """
    x, x_error, z = state.x, state.x_error, state.z
    for g in range(state.orders.shape[0]):
        if state.orders[g] != 0:
            return False
    if tape.surfaces.shape[0] > 0 and not _surfaces_stay(inputs, tape, pin_at, former, state, work):
        return False
    k = row_of(tapes, z, work)
    if k < 0:
        return False
    put(z, work.before)
    put(z, work.now)
    for c in range(z.shape[0]):
        work.on_surface[c], work.released_to[c] = False, NO_SIDE
    for g in range(state.sides.shape[0]):
        work.is_zero[g] = False
    guard_series(tapes, inputs, none, k, LocatedEvent(0.0, _LEAST, x, x_error, state.p, z), x, x_error, work)
    return take_fine_row(automata, none, k, z, True, state, work)


@per_structure
def _surface_tape(system: System, modes: bytes) -> SurfaceTape:
    tape = system.optimised_tape(np.frombuffer(modes, dtype=np.int64))
    inputs, place = system.registers.inputs, system.layout.discrete_slice
    discrete = set(
        inputs.parameters[(inputs.sources >= place.start) & (inputs.sources < place.stop)].tolist()
    )
    rows = np.concatenate([tape.constant_rows, tape.rows])

    def reads_discrete(surface: int) -> bool:
        read = {surface, *live_rows(rows, [surface])[:, 1:4].ravel().tolist()}
        return not read.isdisjoint(discrete)

    surfaces = np.array([r for r in tape.surfaces.tolist() if reads_discrete(r)], dtype=np.int64)
    found: SurfaceTape = packed(SurfaceTape(tape.constant_rows, tape.rows, tape.derivatives, surfaces))
    return found


@per_structure
def _is_supported(system: System) -> bool:
    """Return whether the model consists of expressions, and has no impacts, corners, loads or monitors."""
    is_plain = not (system.led or system.is_unilateral.any() or system.stop_couplings or system.monitor_names)
    return ENABLED and system.has_tape and is_plain


_admit_modes = Precompiled(admit_modes)


def changed_inputs(
    system: System, instant: Instant, state: HybridState, discrete: np.ndarray
) -> HybridState | None:
    """Return the state after a change of discrete values, or None if the general rules must decide.

    state: at this instant, at which no guard is zero; it is not modified.
    """
    if not _is_supported(system):
        return None
    place = system.layout.discrete_slice

    def call(scratch: StartScratch) -> bool:
        changed = scratch.state
        changed.memory[:] = state.memory
        former = system.vector(instant, changed.p[place])
        changed.p[:] = former
        changed.p[place] = discrete
        tape = _surface_tape(system, changed.z.tobytes())
        is_certain: bool = _admit_modes(
            scratch.automata, scratch.tapes, system.registers.inputs, scratch.nothing, tape, system.layout.pin_at,
            former, scratch.as_packed, scratch.work,
        )  # fmt: skip
        return is_certain

    return judged(system, call)
