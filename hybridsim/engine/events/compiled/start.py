"""This module chooses the modes of contacts at the start of a run in compiled code, if the modes are certain.

The rules are those of `hybridsim.engine.events.resolve`, which resolves the other cases and reports problems.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from hybridsim.engine.events.choice.joint_choice import is_below_limit
from hybridsim.engine.events.compiled.guard_series import guard_series, link_interpreted_series
from hybridsim.engine.events.compiled.resolve_surface import choose_modes, cluster_of, take_fine_row
from hybridsim.engine.events.compiled.scratch import (
    AT,
    AT_ERROR,
    LACKS_TAPE,
    MAX_JOINT_COMPONENTS,
    LocatedEvent,
    called_by,
    located,
    row_of,
    work_space,
)
from hybridsim.engine.events.outcome import Outcome
from hybridsim.engine.events.state import HybridState
from hybridsim.engine.linear.tables import no_tables
from hybridsim.engine.native.kernels import ENABLED, Precompiled, call, inline_always, kernel
from hybridsim.engine.native.loop_hints import put
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.series.bounded import UNIT, run_series
from hybridsim.engine.system.per_structure import per_structure, spare_scratch
from hybridsim.engine.system.programs.mode_tables import Tapes, automata_of, tape_cache_of
from hybridsim.engine.system.system import System

_UNKNOWN = -1  # mode not determined yet


@kernel
def plain_start(
    automata: Any, tapes: Any, inputs: Any, none: Any, pin_at: int, surfaces: Any, state: Any, work: Any
) -> bool:
    """Choose all modes from the states, error bounds and run-time vector in `state`; return False if uncertain.

    none: empty tables, so that guards are judged by the tape. pin_at: position of the pin in p. surfaces: see
    `surfaces_of`.
    """
    x, x_error, z, p = state.x, state.x_error, state.z, state.p
    if not _take_sides(automata, inputs, surfaces, pin_at, state, work):
        return False
    for c in range(z.shape[0]):
        if z[c] == _UNKNOWN and not _choose_cluster(automata, tapes, inputs, none, state, c, work):
            return False
    k = row_of(tapes, z, work)
    if k < 0:
        return False
    at = LocatedEvent(0.0, 0.0, x, x_error, p, z)
    guard_series(tapes, inputs, none, k, at, x, x_error, work)
    return take_fine_row(automata, none, k, z, False, state, work)


@inline_always
def _take_sides(automata: Any, inputs: Any, surfaces: Any, pin_at: int, state: Any, work: Any) -> bool:
    """Set the mode of each component by the sign of its surface function; return False if a value is NaN."""
    constant, rows, derivatives, registers, owners = surfaces
    V, E, z, p = work.V, work.E, state.z, state.p
    p[pin_at] = 0.0  # the states as they are, not projected by a holding mode
    run_series(constant, rows, inputs, derivatives, 0.0, 0.0, state.x, state.x_error, p, V, E)
    p[pin_at] = 1.0
    for j in range(registers.shape[0]):
        c, value = owners[j], V[registers[j], 0]
        if not abs(value) < math.inf:
            return False
        work.on_surface[c] = abs(value) <= E[registers[j], 0]
        if work.on_surface[c]:
            z[c] = _UNKNOWN
        else:
            z[c] = automata.above[c] if value > 0.0 else 3 - automata.hold[c] - automata.above[c]
    return True


@inline_always
def _choose_cluster(
    automata: Any, tapes: Any, inputs: Any, none: Any, state: Any, first: int, work: Any
) -> bool:
    """Choose the modes of a cluster's components on their surfaces; return whether the modes are certain."""
    x, x_error, z, p = state.x, state.x_error, state.z, state.p
    members, current, holds, trial, y = work.members, work.current, work.holds, work.trial, work.y
    cluster = cluster_of(automata, first)
    count = 0
    for i in range(cluster.shape[0]):
        c = cluster[i]
        if z[c] == _UNKNOWN:
            if count == members.shape[0]:
                return False
            members[count], current[count], holds[count] = c, automata.hold[c], automata.hold[c]
            count += 1
    for c in range(z.shape[0]):
        trial[c] = max(z[c], 0)
    for i in range(count):
        trial[members[i]] = holds[i]
    call(called_by(work).project, 0.0, x, p, trial, y)
    put(y, x)
    for i in range(count):
        for j in range(automata.pin.shape[1]):
            held = automata.pin[members[i], j]
            if held >= 0:
                x_error[held] = UNIT * abs(x[held])
    work.float_slots[AT] = work.float_slots[AT_ERROR] = 0.0
    put(x, work.x_after)
    put(x_error, work.slopes)
    put(z, work.before)
    put(z, work.now)
    at, k = located(state, work), row_of(tapes, trial, work)
    if k < 0:
        return False
    guard_series(tapes, inputs, none, k, at, work.x_after, work.slopes, work)
    for i in range(count):
        work.keeps[i] = count > 1 and is_below_limit(automata, work, members[i])
    if choose_modes(automata, tapes, inputs, none, at, k, True, count, work) < 0:
        return False
    for i in range(count):
        z[members[i]] = trial[members[i]]
    return True


@per_structure
def surfaces_of(system: System) -> tuple[np.ndarray, ...]:
    """Return the arrays that `plain_start` reads.

    These are the constant rows, the rows, the registers of the rates and of the surfaces, and the component of each
    surface.
    """
    tape = system.optimised_tape(np.zeros(len(system.automata), dtype=np.int64))
    owners = np.array(system.surface_of, dtype=np.int64)
    return tape.constant_rows, tape.rows, tape.derivatives, tape.surfaces, owners


@per_structure
def _is_supported(system: System) -> bool:
    """Return whether compiled code can choose the first modes: there are only contacts, and only a few of them."""
    are_set_valued = all(a.has_surface and not (a.is_unique or a.is_unilateral) for a in system.automata)
    count = len(system.automata)
    return ENABLED and system.has_tape and are_set_valued and 0 < count <= MAX_JOINT_COMPONENTS and not (
        system.stop_couplings or system.monitor_names
    )  # fmt: skip


class StartScratch:
    """The arrays of a call that judges combinations of modes at a point without an event."""

    def __init__(self, system: System, tapes: Tapes) -> None:
        blank = Outcome.blank(system, np.zeros(system.layout.size))
        self.state = HybridState.of(blank, blank.p)
        self.as_packed, self.work, self.nothing = self.state.packed(), work_space(system), no_tables()
        # the code for short series does not know the roundoff of numbers, as it counts at a start
        without = {"bounds": np.zeros_like(tapes.bounds), "lacked": np.zeros_like(tapes.lacked)}
        self.tapes = packed(tapes.arrays._replace(**without))  # type: ignore[attr-defined]  # of a pack
        self.inputs, self.values = system.registers.rounded()
        self.filled = b""  # the run-time vector in `values`
        self.automata, self.surfaces = automata_of(system), surfaces_of(system)
        link_interpreted_series(self.tapes, self.inputs, self.state, self.work)


def judged(system: System, call: Callable[[StartScratch], bool]) -> HybridState | None:
    """Call a kernel that judges the start, and return the resulting state, or None if the kernel returns False.

    The call fills the arrays itself. It is made again as long as it lacks the instruction tapes of some modes.
    """
    spare, cache = spare_scratch(system, "start"), tape_cache_of(system)
    try:
        scratch = spare.pop()
    except IndexError:
        scratch = StartScratch(system, cache.tapes)
    while True:
        slots = scratch.work.int_slots
        slots[LACKS_TAPE] = 0
        is_certain = call(scratch)
        if not slots[LACKS_TAPE]:
            break
        scratch = StartScratch(system, cache.with_modes(scratch.work.missing))
    found = scratch.state.copy() if is_certain else None
    spare.append(scratch)
    return found


_plain_start = Precompiled(plain_start)


def compiled_start(system: System, x0: np.ndarray, x_error: np.ndarray, p: np.ndarray) -> HybridState | None:
    """Return the state just after the start from `x0` with error bounds, or None if the general rules must decide."""
    if not _is_supported(system):
        return None

    def call(scratch: StartScratch) -> bool:
        state = scratch.state
        state.x[:], state.x_error[:], state.p[:] = x0, x_error, p
        key = p.tobytes()
        if scratch.filled != key:
            system.registers.fill(scratch.values, p)
            scratch.filled = key
        is_certain: bool = _plain_start(
            scratch.automata, scratch.tapes, scratch.inputs, scratch.nothing, system.layout.pin_at, scratch.surfaces,
            scratch.as_packed, scratch.work,
        )  # fmt: skip
        return is_certain

    return judged(system, call)
