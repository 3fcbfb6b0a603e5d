"""Events that need no discussion, settled in compiled code: one guard of one component, everything certain just after.

The rules are those of `hybridsim.engine.decide`, as everywhere. What is not ordinary (several guards at once, a case
undecided at rounding, a cascade, no or several admissible motions, an impact, an event in a model that also slides
where it jumps) is left untouched for `hybridsim.engine.settle`, which can say what is the matter.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.decide import (
    FINE,
    LEAVES,
    NONE,
    NONUNIQUE,
    UNDECIDED,
    choose,
    decreed_zeros,
    is_decreed,
    open_question,
    preference,
    side_after,
)
from hybridsim.engine.jets import ORDER, UNIT, run_series
from hybridsim.engine.jit import call, inlined, kernel
from hybridsim.engine.linear_kernels import (
    errors_of_time,
    functions_of_time,
    linear_coefficient,
    linear_side,
)
from hybridsim.engine.packs import packed

SETTLED, NOT_ORDINARY = 0, 1
UNKNOWN = -2  # in place of a verdict
_MOST = 3  # components at their surfaces at once: more make too many candidates to try in passing


class Functions(NamedTuple):
    """Addresses of a model's functions; 0 for those that it does not need."""

    flow: Any
    project: Any
    jumps: Any
    choose: Any
    reset: Any


class Work(NamedTuple):
    """Room for one event: series with bounds (registers, 4), guards' rows of them, what holds after it, candidates.

    factors, w, w_error: functions of time of linear modes, which are to hold at the event when it is settled. sides,
    orders, floors (G,): of the guards just after it. The last ones have a row for each joint candidate.
    """

    V: np.ndarray
    E: np.ndarray
    factors: np.ndarray
    w: np.ndarray
    w_error: np.ndarray
    values: np.ndarray
    bounds: np.ndarray
    sides: np.ndarray
    orders: np.ndarray
    floors: np.ndarray
    on_surface: np.ndarray
    jumps: np.ndarray
    out: np.ndarray
    everything: np.ndarray
    members: np.ndarray
    current: np.ndarray
    holds: np.ndarray
    trial: np.ndarray
    asked: np.ndarray
    candidates: np.ndarray
    ranks: np.ndarray
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
    """Coefficients to third order of the active guards, with bounds, along the flow of the modes in row k, by the tape.

    Linear modes have them as rows over states and functions of time, and are asked for those that decide: `sides_of`.
    """
    if is_linear(lin):
        return
    values, bounds, V, E = work.values, work.bounds, work.V, work.E
    constant = tapes.constant[tapes.constant_start[k] : tapes.constant_start[k + 1]]
    rows = tapes.lean[tapes.lean_start[k] : tapes.lean_start[k + 1]]
    run_series(constant, rows, inputs, tapes.derivatives[k], at.s, at.s_error, x, x_error, at.p, V, E)
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        g = tapes.active[i]
        r = tapes.guards[k, g]
        for j in range(values.shape[1]):
            values[g, j], bounds[g, j] = V[r, j], E[r, j]


@inlined
def is_linear(lin: Any) -> bool:
    """Whether there are tables of linear modes."""
    return lin.kinds.shape[0] > 0


@inlined
def guard_side(
    lin: Any, k: int, g: int, decreed: int, x: Any, x_error: Any, work: Any
) -> tuple[int, int, bool]:
    """Sign of a guard just after, the order that decides it, and whether that is a question of rounding.

    k: the row of the modes whose `guard_series` were asked for last.
    """
    if is_linear(lin):
        return linear_side(lin, k, g, decreed, x, x_error, work.w, work.w_error)
    values, bounds = work.values[g], work.bounds[g]
    side, order = side_after(values, bounds, decreed)
    return side, order, side == 0 and open_question(values, bounds, decreed)


@inlined
def size_at(lin: Any, k: int, g: int, x: Any, x_error: Any, work: Any) -> tuple[float, float]:
    """The value of a guard and its bound."""
    if is_linear(lin):
        return linear_coefficient(lin, k, g, 0, x, x_error, work.w, work.w_error)
    return work.values[g, 0], work.bounds[g, 0]


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
def judge_members(
    automata: Any,
    lin: Any,
    k: int,
    at: Any,
    x: Any,
    x_error: Any,
    z: Any,
    members: Any,
    fired: int,
    is_on: bool,
    continuous: bool,
    work: Any,
    sides: Any,
    orders: Any,
    floors: Any,
) -> int:
    """Verdict on the guards of some components in the candidate z, which row k is of.

    sides, orders, floors: of all guards, with bounds of their values; of use unless the verdict is LEAVES. is_on: the
    located guard is still to be crossed; a corner's is at zero on both its sides. continuous: all unknowns stay as they
    were.
    """
    on_surface, guards_of, hold = work.on_surface, automata.guards_of, automata.hold
    verdict = FINE
    for g in range(sides.shape[0]):
        sides[g], orders[g], floors[g] = 1, 0, 0.0
    for i in range(members.shape[0]):
        c = members[i]
        is_holding = hold[c] >= 0 and z[c] == hold[c]
        is_smooth = continuous and is_release(automata, at.z, z, c, fired)
        for j in range(guards_of.shape[2]):
            g = guards_of[c, z[c], j]
            if g < 0:
                continue
            is_fired = is_on and g == fired and (z[c] == at.z[c] or automata.is_corner[c])
            is_fired = is_fired and is_decreed(is_holding, continuous)
            zeros = decreed_zeros(
                j == 0, on_surface[c], is_holding, is_smooth, is_fired, automata.is_unilateral[c]
            )
            side, order, is_open = guard_side(lin, k, g, zeros, x, x_error, work)
            if side < 0:
                return LEAVES
            sides[g], orders[g] = side, order if order <= ORDER else 0
            if order > 0:
                floors[g] = size_at(lin, k, g, x, x_error, work)[1]
            if is_open:
                verdict = UNDECIDED
    return verdict


@inlined
def is_alone(tapes: Any, lin: Any, k: int, fired: int, x: Any, x_error: Any, work: Any) -> bool:
    """Whether no other guard is zero within its bound and leaves together with the one that fired."""
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        g = tapes.active[i]
        if g == fired:
            continue
        value, bound = size_at(lin, k, g, x, x_error, work)
        if not abs(value) > bound and guard_side(lin, k, g, 1, x, x_error, work)[0] < 0:
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
    discrete: Any,
    x: Any,
    x_error: Any,
    z: Any,
    p: Any,
    work: Any,
) -> tuple[int, bool]:
    """What holds just after the event, written to x, x_error and z; (SETTLED, whether the flow goes on smoothly).

    A transition of a component without a surface may change the run-time vector: it is written to p then. NOT_ORDINARY
    leaves the event to others, whatever has been written. Sides, orders and floors of the guards in the new modes are
    in the work space. discrete: how many discrete states there are and where in p.
    """
    put(at.x, x)
    put(at.x_error, x_error)
    put(at.z, z)
    on_surface, sides, orders, floors = work.on_surface, work.sides, work.orders, work.floors
    for i in range(on_surface.shape[0]):
        on_surface[i] = False
    k = find_modes(tapes.modes, z)
    if k < 0:
        return NOT_ORDINARY, False
    is_known = tapes.active_start[k + 1] - tapes.active_start[k] > 1
    if is_known:
        guard_series(tapes, inputs, lin, k, at, x, x_error, work)
        if not is_alone(tapes, lin, k, fired, x, x_error, work):
            return NOT_ORDINARY, False
    c = automata.owner[fired]
    for i in range(automata.cluster_start[c], automata.cluster_start[c + 1]):
        if automata.is_unilateral[automata.cluster[i]]:
            return NOT_ORDINARY, False
    if automata.hold[c] >= 0:
        number = decide_surface(
            functions, automata, tapes, inputs, lin, at, fired, is_known, x, x_error, z, work
        )
        if number < 0:
            return NOT_ORDINARY, False
        if (
            automata.cluster_start[c + 1] - automata.cluster_start[c] == z.shape[0]
        ):  # all has been judged there
            put(work.all_sides[number], sides)
            put(work.all_orders[number], orders)
            put(work.all_floors[number], floors)
            return SETTLED, work.smooth[number]
        continuous = is_continuous(functions, automata, at, x, z, work.everything, fired, work.jumps)
        is_on, vector = z[c] == at.z[c], at.p
    else:
        put(at.p, p)
        if not take_choice(functions, automata, at, fired, discrete, x, x_error, z, p, work):
            return NOT_ORDINARY, False
        if is_linear(lin):
            functions_of_time(lin, at.s, p, work.factors, work.w)
            errors_of_time(lin, at.s, at.s_error, p, work.factors, work.w_error)
        continuous, is_on, vector = False, automata.is_corner[c], p
    k = find_modes(tapes.modes, z)
    if k < 0:
        return NOT_ORDINARY, False
    after = Before(at.s, at.s_error, x, x_error, vector, at.z)
    guard_series(tapes, inputs, lin, k, after, x, x_error, work)
    verdict = judge_members(
        automata, lin, k, at, x, x_error, z, work.everything, fired, is_on, continuous, work, sides, orders, floors
    )  # fmt: skip
    return (SETTLED, continuous) if verdict == FINE else (NOT_ORDINARY, False)


@kernel
def judge_candidate(
    functions: Any,
    automata: Any,
    tapes: Any,
    inputs: Any,
    lin: Any,
    at: Any,
    fired: int,
    is_known: bool,
    x: Any,
    x_error: Any,
    cluster: Any,
    number: int,
    work: Any,
) -> int:
    """Verdict on the modes in `work.trial`, with what goes with it in the work space's rows of that number.

    UNKNOWN where these modes are not on the shelf. is_known: their guards' series are there.
    """
    k = find_modes(tapes.modes, work.trial)
    if k < 0:
        return UNKNOWN
    if not is_known:
        guard_series(tapes, inputs, lin, k, at, x, x_error, work)
    continuous = is_continuous(functions, automata, at, x, work.trial, cluster, fired, work.jumps)
    work.smooth[number] = continuous
    return judge_members(
        automata, lin, k, at, x, x_error, work.trial, cluster, fired, True, continuous, work,
        work.all_sides[number], work.all_orders[number], work.all_floors[number],
    )  # fmt: skip


@inlined
def decide_single(
    functions: Any,
    automata: Any,
    tapes: Any,
    inputs: Any,
    lin: Any,
    at: Any,
    fired: int,
    is_known: bool,
    x: Any,
    x_error: Any,
    z: Any,
    cluster: Any,
    c: int,
    work: Any,
) -> int:
    """As `decide_surface`, for one component at its surface: what `choose` makes of its three modes, one by one."""
    now, hold, trial = z[c], automata.hold[c], work.trial
    trial[c] = now
    verdict = judge_candidate(
        functions, automata, tapes, inputs, lin, at, fired, is_known, x, x_error, cluster, now, work
    )
    if verdict != LEAVES:
        return now if verdict == FINE else -1
    if now != hold:
        for mode in (hold, 3 - hold - now):
            trial[c] = mode
            verdict = judge_candidate(
                functions, automata, tapes, inputs, lin, at, fired, False, x, x_error, cluster, mode, work
            )
            if verdict == FINE:
                z[c] = mode
                return mode
            if verdict != LEAVES:
                return -1
        return -1
    found = -1
    for mode in range(3):
        if mode == hold:
            continue
        trial[c] = mode
        verdict = judge_candidate(
            functions, automata, tapes, inputs, lin, at, fired, False, x, x_error, cluster, mode, work
        )
        if verdict == LEAVES:
            continue
        if verdict != FINE or found >= 0:
            return -1
        found = mode
    if found >= 0:
        z[c] = found
    return found


@kernel
def decide_surface(
    functions: Any,
    automata: Any,
    tapes: Any,
    inputs: Any,
    lin: Any,
    at: Any,
    fired: int,
    is_known: bool,
    x: Any,
    x_error: Any,
    z: Any,
    work: Any,
) -> int:
    """The admissible modes, written to z, of the components of a cluster that are at their surfaces.

    Returns the number of that candidate; -1 where it is not plain. Candidates are tried in the order in which `choose`
    prefers them, up to the first that it will take. is_known: the guards' series of the modes before are there.
    """
    members, trial, candidates, verdicts = work.members, work.trial, work.candidates, work.verdicts
    hold, pin, current, holds = automata.hold, automata.pin, work.current, work.holds
    ranks = work.ranks
    c = automata.owner[fired]
    cluster = automata.cluster[automata.cluster_start[c] : automata.cluster_start[c + 1]]
    count, is_meeting = 0, False
    for i in range(cluster.shape[0]):
        d = cluster[i]
        if d == c or z[d] == hold[d]:
            if count == members.shape[0]:
                return -1
            members[count], current[count], holds[count] = d, z[d], hold[d]
            count += 1
            work.on_surface[d] = True
            is_meeting = is_meeting or automata.is_unique[d]
    if is_meeting and count > 1:
        return -1
    put(z, trial)
    for i in range(count):
        trial[members[i]] = hold[members[i]]
    call(functions.project, at.s, at.x, at.p, trial, x)
    for i in range(count):
        if pin[members[i], 0] >= 0:  # a unilateral contact, which has two, is not ordinary
            x_error[pin[members[i], 0]] = UNIT * abs(x[pin[members[i], 0]])
    for i in range(x.shape[0]):
        is_known = is_known and x[i] == at.x[i] and x_error[i] == at.x_error[i]
    if count == 1:
        return decide_single(
            functions, automata, tapes, inputs, lin, at, fired, is_known, x, x_error, z, cluster, members[0], work
        )  # fmt: skip
    total = 3**count  # a surface has three modes
    for number in range(total):
        rest = number
        for i in range(count - 1, -1, -1):
            candidates[number, i] = rest % 3
            rest //= 3
        verdicts[number] = LEAVES
        ranks[number] = preference(candidates[number], current, holds, count)
    is_found = False
    for rank in range((count + 1) * (count + 1) - 1, -1, -1):
        if is_found:
            break
        for number in range(total):
            if ranks[number] != rank:
                continue
            for i in range(count):
                trial[members[i]] = candidates[number, i]
            is_current = rank >= (count + 1) * count
            verdict = judge_candidate(
                functions, automata, tapes, inputs, lin, at, fired, is_current and is_known, x, x_error, cluster,
                number, work,
            )  # fmt: skip
            if verdict == UNKNOWN:
                return -1
            verdicts[number] = verdict
            is_found = is_found or verdict == FINE or (is_current and verdict != LEAVES)
    number = choose(candidates[:total, :count], verdicts[:total], current[:count], holds[:count])
    if number in (NONE, NONUNIQUE) or verdicts[number] != FINE:
        return -1
    for i in range(count):
        z[members[i]] = candidates[number, i]
    return number


@kernel
def take_choice(
    functions: Any,
    automata: Any,
    at: Any,
    fired: int,
    discrete: Any,
    x: Any,
    x_error: Any,
    z: Any,
    p: Any,
    work: Any,
) -> bool:
    """The declared transition of the guard, with its reset; False where surfaces may have been jumped over."""
    for d in range(z.shape[0]):
        if automata.hold[d] >= 0 and not automata.is_corner[automata.owner[fired]]:
            return False
    c, n, count = automata.owner[fired], x.shape[0], z.shape[0]
    n_discrete, discrete_at = discrete
    mode, place = at.z[c], automata.place[fired]
    asked = work.asked
    put(at.z, asked)
    asked[count], asked[count + 1], asked[count + 2] = c, mode, place
    call(functions.choose, at.s, at.x, at.p, asked, work.out)
    number = int(work.out[0])
    if number < 0:
        return False
    z[c] = automata.target[c, mode, place, number]
    reset = automata.reset[c, mode, place, number]
    if reset >= 0:
        out = work.out
        put(at.x, out)
        for i in range(n_discrete):
            out[n + i] = at.p[discrete_at + i]
        asked[count] = reset
        call(functions.reset, at.s, at.x, at.p, asked, out)
        for i in range(n):
            x[i] = out[i]
        for i in range(n_discrete):
            p[discrete_at + i] = out[n + i]
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
            sides=np.ones(guards, dtype=np.int64),
            orders=numbers(guards),
            floors=np.zeros(guards),
            on_surface=flags(count),
            jumps=np.zeros(2 * max(len(system.surface_of), 1)),
            out=np.zeros(max(system.n + len(system.model.discrete), 1)),
            everything=np.arange(count, dtype=np.int64),
            members=numbers(together),
            current=numbers(together),
            holds=numbers(together),
            trial=numbers(count),
            asked=numbers(count + 3),
            candidates=numbers(joint, together),
            ranks=numbers(joint),
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
