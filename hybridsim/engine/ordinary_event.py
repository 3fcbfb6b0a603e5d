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
from hybridsim.engine.jit import call, inlined, kernel
from hybridsim.engine.linear_kernels import functions_of_time, linear_series
from hybridsim.engine.packs import packed

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
    """Room for one event: series with bounds (registers, 4), guards' rows of them, vectors of flags, candidates.

    factors, w, w_error: functions of time of linear modes. The last ones have a row for each joint candidate.
    """

    V: np.ndarray
    E: np.ndarray
    factors: np.ndarray
    w: np.ndarray
    w_error: np.ndarray
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
    everything: np.ndarray
    members: np.ndarray
    current: np.ndarray
    holds: np.ndarray
    trial: np.ndarray
    table: np.ndarray
    asked: np.ndarray
    candidates: np.ndarray
    verdicts: np.ndarray
    smooth: np.ndarray
    all_sides: np.ndarray
    all_orders: np.ndarray
    all_floors: np.ndarray


class Before(NamedTuple):
    """An event as it was located: local time and its error, state, its error bounds, run-time vector, modes."""

    s: float
    s_error: float
    x: np.ndarray
    x_error: np.ndarray
    p: np.ndarray
    z: np.ndarray


@inlined
def put(source: Any, out: Any) -> None:
    """Copy an array; a slice assignment takes ten times as long for a few numbers."""
    for i in range(source.shape[0]):
        out[i] = source[i]


@inlined
def find_modes(modes: Any, z: Any) -> int:
    """Row of a vector of modes on the shelf; -1 where it is not."""
    for k in range(modes.shape[0]):
        same = True
        for c in range(z.shape[0]):
            same = same and modes[k, c] == z[c]
        if same:
            return k
    return -1


@inlined
def guard_series(tapes: Any, inputs: Any, lin: Any, k: int, at: Any, x: Any, x_error: Any, work: Any) -> None:
    """Coefficients to third order of the active guards, with bounds, along the flow of the modes in row k.

    Linear modes have them as rows over states and functions of time, which the work space holds at this time; other
    modes by the tape.
    """
    if lin.kinds.shape[0] > 0:
        linear_series(lin, tapes, k, x, x_error, work.w, work.w_error, work.values, work.bounds)
        return
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


@inlined
def is_release(automata: Any, before: Any, z: Any, c: int, fired: int) -> bool:
    """Whether a component leaves its holding mode through the guard that was located."""
    if automata.hold[c] < 0 or before[c] != automata.hold[c] or z[c] == automata.hold[c]:
        return False
    side = 0 if z[c] == automata.above[c] else 1
    return automata.owner[fired] == c and automata.place[fired] == side


@inlined
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


@inlined
def decree(automata: Any, at: Any, z: Any, fired: int, is_on: bool, continuous: bool, work: Any) -> None:
    """Leading zeros of all guards in the candidate z; `is_on`: the located guard is still to be crossed."""
    work.fired[:] = False
    work.fired[fired] = is_on and z[automata.owner[fired]] == at.z[automata.owner[fired]]
    for c in range(z.shape[0]):
        work.holding[c] = automata.hold[c] >= 0 and z[c] == automata.hold[c]
        work.released[c] = is_release(automata, at.z, z, c, fired)
        for j in range(work.table.shape[1]):
            work.table[c, j] = automata.guards_of[c, z[c], j]
    work.decreed[:] = 0
    decree_orders(
        work.table, work.holding, work.on_surface, work.released, continuous, work.fired, work.decreed
    )


@inlined
def judge_members(automata: Any, z: Any, members: Any, work: Any) -> int:
    """Verdict on the guards of some components; their sides and orders stay in the work space."""
    work.active[:] = False
    for i in range(members.shape[0]):
        c = members[i]
        for j in range(automata.guards_of.shape[2]):
            if automata.guards_of[c, z[c], j] >= 0:
                work.active[automata.guards_of[c, z[c], j]] = True
    return judge(work.values, work.bounds, work.decreed, work.active, False, work.sides, work.orders)


@inlined
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
    lin: Any,
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

    NOT_ORDINARY leaves the event to others, whatever has been written. Sides, orders and bounds of the guards' values
    in the new modes are in the work space.
    """
    put(at.x, x)
    put(at.x_error, x_error)
    put(at.z, z)
    put(at.p, p)
    work.on_surface[:] = False
    k = find_modes(tapes.modes, z)
    if k < 0:
        return NOT_ORDINARY, False
    if lin.kinds.shape[0] > 0:
        functions_of_time(lin, at.s, at.s_error, p, work.factors, work.w, work.w_error)
    if tapes.active_start[k + 1] - tapes.active_start[k] > 1:
        guard_series(tapes, inputs, lin, k, at, x, x_error, work)
        if not is_alone(tapes, k, fired, work):
            return NOT_ORDINARY, False
    c = automata.owner[fired]
    if automata.hold[c] >= 0:
        number = decide_surface(functions, automata, tapes, inputs, lin, at, fired, x, x_error, z, work)
        if number < 0:
            return NOT_ORDINARY, False
        if (
            automata.cluster_start[c + 1] - automata.cluster_start[c] == z.shape[0]
        ):  # all has been judged there
            for g in range(work.sides.shape[0]):
                work.sides[g], work.orders[g] = work.all_sides[number, g], work.all_orders[number, g]
                work.bounds[g, 0] = work.all_floors[number, g]
            return SETTLED, work.smooth[number]
        continuous = is_continuous(functions, automata, at, x, z, work.everything, fired, work.jumps)
        is_on = z[c] == at.z[c]
    else:
        if not take_choice(functions, automata, at, fired, n_discrete, discrete_at, x, x_error, z, p, work):
            return NOT_ORDINARY, False
        if lin.kinds.shape[0] > 0:
            functions_of_time(lin, at.s, at.s_error, p, work.factors, work.w, work.w_error)
        continuous, is_on = False, False
    k = find_modes(tapes.modes, z)
    if k < 0:
        return NOT_ORDINARY, False
    after = Before(at.s, at.s_error, x, x_error, p, at.z)
    guard_series(tapes, inputs, lin, k, after, x, x_error, work)
    decree(automata, at, z, fired, is_on, continuous, work)
    if judge_members(automata, z, work.everything, work) != FINE:
        return NOT_ORDINARY, False
    return SETTLED, continuous


@kernel
def decide_surface(
    functions: Any,
    automata: Any,
    tapes: Any,
    inputs: Any,
    lin: Any,
    at: Any,
    fired: int,
    x: Any,
    x_error: Any,
    z: Any,
    work: Any,
) -> int:
    """The admissible modes, written to z, of the components of a cluster that are at their surfaces.

    Returns the number of that candidate; -1 where it is not plain.
    """
    c = automata.owner[fired]
    cluster = automata.cluster[automata.cluster_start[c] : automata.cluster_start[c + 1]]
    count = 0
    for i in range(cluster.shape[0]):
        d = cluster[i]
        if d == c or z[d] == automata.hold[d]:
            if count == work.members.shape[0]:
                return -1
            work.members[count] = d
            count += 1
            work.on_surface[d] = True
    total, trial = 3**count, work.trial  # a surface has three modes
    put(z, trial)
    for i in range(count):
        d = work.members[i]
        trial[d] = automata.hold[d]
    call(functions.project, at.s, at.x, at.p, trial, x)
    for i in range(count):
        d = work.members[i]
        x_error[automata.pin[d]] = UNIT * abs(x[automata.pin[d]])
    for number in range(total):
        rest = number
        for i in range(count - 1, -1, -1):
            work.candidates[number, i] = rest % 3
            trial[work.members[i]] = rest % 3
            rest //= 3
        k = find_modes(tapes.modes, trial)
        if k < 0:
            return -1
        guard_series(tapes, inputs, lin, k, at, x, x_error, work)
        continuous = is_continuous(functions, automata, at, x, trial, cluster, fired, work.jumps)
        decree(automata, at, trial, fired, True, continuous, work)
        work.verdicts[number] = judge_members(automata, trial, cluster, work)
        work.smooth[number] = continuous
        for g in range(work.sides.shape[0]):
            work.all_sides[number, g], work.all_orders[number, g] = work.sides[g], work.orders[g]
            work.all_floors[number, g] = work.bounds[g, 0]
    for i in range(count):
        work.current[i], work.holds[i] = z[work.members[i]], automata.hold[work.members[i]]
    number = choose(
        work.candidates[:total, :count], work.verdicts[:total], work.current[:count], work.holds[:count]
    )
    if number in (NONE, NONUNIQUE) or work.verdicts[number] != FINE:
        return -1
    for i in range(count):
        z[work.members[i]] = work.candidates[number, i]
    return number


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
    asked = work.asked
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


def work_space(system: Any, atoms: int = 0, monomials: int = 0) -> Work:
    """Room for the events of one system; for linear modes also for their functions of time."""
    guards, count = system.guard_count, len(system.automata)
    registers = system.registers.count
    widest = max((len(g) for a in system.automata for g in a.guards), default=0) or 1
    together = min(_MOST, len(system.surface_of))
    joint = 3**together

    def numbers(*shape: int) -> np.ndarray:
        return np.zeros(shape, dtype=np.int64)

    def flags(size: int) -> np.ndarray:
        return np.zeros(size, dtype=np.bool_)

    work: Work = packed(
        Work(
            V=np.empty((registers, ORDER + 1)),
            E=np.empty((registers, ORDER + 1)),
            factors=np.zeros((2 * atoms, 2)),
            w=np.zeros(monomials),
            w_error=np.zeros(monomials),
            values=np.empty((guards, ORDER + 1)),
            bounds=np.empty((guards, ORDER + 1)),
            decreed=numbers(guards),
            active=flags(guards),
            sides=np.ones(guards, dtype=np.int64),
            orders=numbers(guards),
            fired=flags(guards),
            holding=flags(count),
            on_surface=flags(count),
            released=flags(count),
            jumps=np.zeros(2 * max(len(system.surface_of), 1)),
            out=np.zeros(max(system.n + len(system.model.discrete), 1)),
            everything=np.arange(count, dtype=np.int64),
            members=numbers(together),
            current=numbers(together),
            holds=numbers(together),
            trial=numbers(count),
            table=numbers(count, widest),
            asked=numbers(count + 3),
            candidates=numbers(joint, together),
            verdicts=numbers(joint),
            smooth=flags(joint),
            all_sides=numbers(joint, guards),
            all_orders=numbers(joint, guards),
            all_floors=np.zeros((joint, guards)),
        )
    )
    return work


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
