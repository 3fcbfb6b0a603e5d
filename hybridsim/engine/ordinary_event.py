"""Events that need no discussion, settled in compiled code: one guard of one component, everything certain just after.

The rules are those of `hybridsim.engine.decide`, as everywhere. What is not ordinary (several guards at once, a case
undecided at rounding, a cascade, no or several admissible motions, an event in a model that also slides where it
jumps) is left untouched for `hybridsim.engine.settle`, which can say what is the matter.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.decide import FINE, NONE, NONUNIQUE, choose, decree_orders, judge, side_after
from hybridsim.engine.jets import ORDER, UNIT, run_series
from hybridsim.engine.jit import call, kernel

SETTLED, NOT_ORDINARY = 0, 1
_MOST = 3  # components at their surfaces at once: more make too many candidates to try in passing


class Functions(NamedTuple):
    """Addresses of a model's functions; 0 for those that it does not need."""

    flow: Any
    project: Any
    jumps: Any
    choose: Any
    reset: Any


class Work(NamedTuple):
    """Room for one event: series with bounds (registers, 4), guards' rows of them, and vectors of flags."""

    V: np.ndarray
    E: np.ndarray
    values: np.ndarray
    bounds: np.ndarray
    decreed: np.ndarray
    active: np.ndarray
    sides: np.ndarray
    orders: np.ndarray
    fired: np.ndarray
    holding: np.ndarray
    on_surface: np.ndarray
    released: np.ndarray
    jumps: np.ndarray
    out: np.ndarray


class Before(NamedTuple):
    """An event as it was located: local time and its error, state, its error bounds, run-time vector, modes."""

    s: float
    s_error: float
    x: np.ndarray
    x_error: np.ndarray
    p: np.ndarray
    z: np.ndarray


@kernel
def find_modes(modes: Any, z: Any) -> int:
    """Row of a vector of modes on the shelf; -1 where it is not."""
    for k in range(modes.shape[0]):
        same = True
        for c in range(z.shape[0]):
            same = same and modes[k, c] == z[c]
        if same:
            return k
    return -1


@kernel
def guard_series(tapes: Any, inputs: Any, k: int, at: Any, x: Any, x_error: Any, work: Any) -> None:
    """Coefficients to third order of the active guards, with bounds, along the flow of the modes in row k."""
    constant = tapes.constant[tapes.constant_start[k] : tapes.constant_start[k + 1]]
    rows = tapes.lean[tapes.lean_start[k] : tapes.lean_start[k + 1]]
    run_series(
        constant, rows, inputs, tapes.derivatives[k], at.s, at.s_error, x, x_error, at.p, work.V, work.E
    )
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        g = tapes.active[i]
        r = tapes.guards[k, g]
        for j in range(work.values.shape[1]):
            work.values[g, j], work.bounds[g, j] = work.V[r, j], work.E[r, j]


@kernel
def is_release(automata: Any, before: Any, z: Any, c: int, fired: int) -> bool:
    """Whether a component leaves its holding mode through the guard that was located."""
    if automata.hold[c] < 0 or before[c] != automata.hold[c] or z[c] == automata.hold[c]:
        return False
    side = 0 if z[c] == automata.above[c] else 1
    return automata.owner[fired] == c and automata.place[fired] == side


@kernel
def is_continuous(
    functions: Any, automata: Any, at: Any, x: Any, z: Any, members: Any, fired: int, jumps: Any
) -> bool:
    """Whether every change among some components is a release at which nothing jumps."""
    asked = False
    for i in range(members.shape[0]):
        c = members[i]
        if z[c] == at.z[c]:
            continue
        if not is_release(automata, at.z, z, c, fired):
            return False
        if not asked:
            call(functions.jumps, at.s, x, at.p, z, jumps)
            asked = True
        side = 0 if z[c] == automata.above[c] else 1
        if jumps[2 * automata.surface[c] + side] != 0.0:
            return False
    return True


@kernel
def decree(automata: Any, at: Any, z: Any, fired: int, is_on: bool, continuous: bool, work: Any) -> None:
    """Leading zeros of all guards in the candidate z; `is_on`: the located guard is still to be crossed."""
    work.fired[:] = False
    work.fired[fired] = is_on and z[automata.owner[fired]] == at.z[automata.owner[fired]]
    for c in range(z.shape[0]):
        work.holding[c] = automata.hold[c] >= 0 and z[c] == automata.hold[c]
        work.released[c] = is_release(automata, at.z, z, c, fired)
    table = np.empty((z.shape[0], automata.guards_of.shape[2]), dtype=np.int64)
    for c in range(z.shape[0]):
        table[c] = automata.guards_of[c, z[c]]
    work.decreed[:] = 0
    decree_orders(table, work.holding, work.on_surface, work.released, continuous, work.fired, work.decreed)


@kernel
def judge_members(automata: Any, z: Any, members: Any, work: Any) -> int:
    """Verdict on the guards of some components; their sides and orders stay in the work space."""
    work.active[:] = False
    for i in range(members.shape[0]):
        c = members[i]
        for j in range(automata.guards_of.shape[2]):
            if automata.guards_of[c, z[c], j] >= 0:
                work.active[automata.guards_of[c, z[c], j]] = True
    return judge(work.values, work.bounds, work.decreed, work.active, False, work.sides, work.orders)


@kernel
def is_alone(tapes: Any, k: int, fired: int, work: Any) -> bool:
    """Whether no other guard is zero within its bound and leaves together with the one that fired."""
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        g = tapes.active[i]
        if g == fired:
            continue
        is_zero = not abs(work.values[g, 0]) > work.bounds[g, 0]
        if is_zero and side_after(work.values[g], work.bounds[g], 1)[0] < 0:
            return False
    return True


@kernel
def settle_ordinary(
    functions: Any,
    automata: Any,
    tapes: Any,
    inputs: Any,
    at: Any,
    fired: int,
    n_discrete: int,
    discrete_at: int,
    x: Any,
    x_error: Any,
    z: Any,
    p: Any,
    work: Any,
) -> tuple[int, bool]:
    """What holds just after the event, written to x, x_error, z and p; (SETTLED, whether the flow goes on smoothly).

    NOT_ORDINARY leaves the event to others, whatever has been written. Sides, orders and the guards' series of the
    new modes are in the work space.
    """
    everything = np.arange(z.shape[0])
    x[:], x_error[:], z[:], p[:] = at.x, at.x_error, at.z, at.p
    work.on_surface[:] = False
    k = find_modes(tapes.modes, z)
    if k < 0:
        return NOT_ORDINARY, False
    guard_series(tapes, inputs, k, at, x, x_error, work)
    if not is_alone(tapes, k, fired, work):
        return NOT_ORDINARY, False
    c = automata.owner[fired]
    jumped = automata.hold[c] < 0
    if jumped:
        if not take_choice(functions, automata, at, fired, n_discrete, discrete_at, x, x_error, z, p, work):
            return NOT_ORDINARY, False
    elif not decide_surface(functions, automata, tapes, inputs, at, fired, x, x_error, z, work):
        return NOT_ORDINARY, False
    k = find_modes(tapes.modes, z)
    if k < 0:
        return NOT_ORDINARY, False
    after = Before(at.s, at.s_error, x, x_error, p, at.z)
    continuous = not jumped and is_continuous(functions, automata, at, x, z, everything, fired, work.jumps)
    guard_series(tapes, inputs, k, after, x, x_error, work)
    decree(automata, at, z, fired, not jumped and z[c] == at.z[c], continuous, work)
    if judge_members(automata, z, everything, work) != FINE:
        return NOT_ORDINARY, False
    return SETTLED, continuous


@kernel
def decide_surface(
    functions: Any,
    automata: Any,
    tapes: Any,
    inputs: Any,
    at: Any,
    fired: int,
    x: Any,
    x_error: Any,
    z: Any,
    work: Any,
) -> bool:
    """The admissible modes of the components of a cluster that are at their surfaces; False where it is not plain."""
    c = automata.owner[fired]
    cluster = automata.cluster[automata.cluster_start[c] : automata.cluster_start[c + 1]]
    members = np.empty(_MOST, dtype=np.int64)
    count = 0
    for i in range(cluster.shape[0]):
        d = cluster[i]
        if d == c or z[d] == automata.hold[d]:
            if count == _MOST:
                return False
            members[count] = d
            count += 1
            work.on_surface[d] = True
    members = members[:count]
    total = 3**count  # a surface has three modes
    candidates, verdicts = np.empty((total, count), dtype=np.int64), np.empty(total, dtype=np.int64)
    held = z.copy()
    for i in range(count):
        held[members[i]] = automata.hold[members[i]]
    call(functions.project, at.s, at.x, at.p, held, x)
    for i in range(count):
        x_error[automata.pin[members[i]]] = UNIT * abs(x[automata.pin[members[i]]])
    trial = z.copy()
    for number in range(total):
        rest = number
        for i in range(count - 1, -1, -1):
            candidates[number, i] = rest % 3
            trial[members[i]] = rest % 3
            rest //= 3
        k = find_modes(tapes.modes, trial)
        if k < 0:
            return False
        guard_series(tapes, inputs, k, at, x, x_error, work)
        continuous = is_continuous(functions, automata, at, x, trial, cluster, fired, work.jumps)
        decree(automata, at, trial, fired, True, continuous, work)
        verdicts[number] = judge_members(automata, trial, cluster, work)
    current, holds = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    for i in range(count):
        current[i], holds[i] = z[members[i]], automata.hold[members[i]]
    number = choose(candidates, verdicts, current, holds)
    if number in (NONE, NONUNIQUE) or verdicts[number] != FINE:
        return False
    for i in range(count):
        z[members[i]] = candidates[number, i]
    return True


@kernel
def take_choice(
    functions: Any,
    automata: Any,
    at: Any,
    fired: int,
    n_discrete: int,
    discrete_at: int,
    x: Any,
    x_error: Any,
    z: Any,
    p: Any,
    work: Any,
) -> bool:
    """The declared transition of the guard, with its reset; False where surfaces may have been jumped over."""
    for d in range(z.shape[0]):
        if automata.hold[d] >= 0:
            return False
    c, n, count = automata.owner[fired], x.shape[0], z.shape[0]
    mode, place = at.z[c], automata.place[fired]
    asked = np.empty(count + 3, dtype=np.int64)
    asked[:count] = at.z
    asked[count], asked[count + 1], asked[count + 2] = c, mode, place
    call(functions.choose, at.s, at.x, at.p, asked, work.out)
    number = int(work.out[0])
    if number < 0:
        return False
    z[c] = automata.target[c, mode, place, number]
    reset = automata.reset[c, mode, place, number]
    if reset >= 0:
        work.out[:n], work.out[n : n + n_discrete] = at.x, at.p[discrete_at : discrete_at + n_discrete]
        asked[count] = reset
        call(functions.reset, at.s, at.x, at.p, asked, work.out)
        x[:], p[discrete_at : discrete_at + n_discrete] = work.out[:n], work.out[n : n + n_discrete]
        for i in range(automata.reset_start[reset], automata.reset_start[reset + 1]):
            slot = automata.reset_slot[i]
            if slot < n:
                x_error[slot] = UNIT * abs(x[slot])
                if not math.isfinite(x[slot]):
                    return False
    return True


def work_space(system: Any) -> Work:
    """Room for the events of one system."""
    guards, count = system.guard_count, len(system.automata)
    registers = system.registers.count

    def flags(size: int) -> np.ndarray:
        return np.zeros(size, dtype=np.bool_)

    return Work(
        np.empty((registers, ORDER + 1)),
        np.empty((registers, ORDER + 1)),
        np.empty((guards, ORDER + 1)),
        np.empty((guards, ORDER + 1)),
        np.zeros(guards, dtype=np.int64),
        flags(guards),
        np.ones(guards, dtype=np.int64),
        np.zeros(guards, dtype=np.int64),
        flags(guards),
        flags(count),
        flags(count),
        flags(count),
        np.zeros(2 * max(len(system.surface_of), 1)),
        np.zeros(max(system.n + len(system.model.discrete), 1)),
    )


def functions_of(system: Any) -> Functions:
    """The functions that a compiled loop calls."""
    return system.code.shared("loop functions", lambda: _functions(system))


def _functions(system: Any) -> Functions:
    has_surface = any(a.has_surface for a in system.automata)
    has_choice = any(not a.has_surface for a in system.automata)
    none: Any = system.address("flow")  # never called
    return Functions(
        system.address("flow"),
        system.address("project") if has_surface else none,
        system.address("jumps") if has_surface else none,
        system.address("choose") if has_choice else none,
        system.address("reset") if has_choice else none,
    )
