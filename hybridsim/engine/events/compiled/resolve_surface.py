"""Resolve events at surfaces in compiled loops: find the modes that are admissible after the event."""

from __future__ import annotations

from typing import Any

from hybridsim.engine.events.choice.joint_choice import (
    NO_SCORE,
    NONE,
    is_current,
    is_settled,
    joint_choice,
    rank_candidates,
)
from hybridsim.engine.events.choice.verdict import FINE, LEAVES, UNDECIDED, verdict
from hybridsim.engine.events.compiled.guard_series import guard_series, is_continuous
from hybridsim.engine.events.compiled.scratch import ROW, called_by, located, row_of
from hybridsim.engine.linear.guard_coefficients import measure_point
from hybridsim.engine.native.kernels import call, call_noinline, inline_always, inlined
from hybridsim.engine.native.loop_hints import put, short_loop
from hybridsim.engine.series.bounded import UNIT

SURFACE_MODES = 3  # modes of a surface


@inline_always
def cluster_of(automata: Any, c: int) -> Any:
    """Return the components whose modes are chosen together with the mode of component `c`."""
    return automata.cluster[automata.cluster_start[c] : automata.cluster_start[c + 1]]


@inlined
def row_verdict(
    automata: Any, lin: Any, k: int, z: Any, members: Any, continuous: bool, row: int, work: Any
) -> int:
    """Return the verdict on the guards of `members` in the modes of row `k`, and ignore all other guards.

    A monitor that stays at zero has reached its event, which compiled loops do not record. It is UNDECIDED.
    """
    for g in range(work.all_sides.shape[1]):
        short_loop()
        work.all_sides[row, g], work.all_orders[row, g], work.all_floors[row, g] = 1, 0, 0.0
    found = call_noinline(verdict, (automata, lin, k, work, z, members, continuous, False, row))
    for g in range(work.all_sides.shape[1]):
        short_loop()
        if work.all_sides[row, g] == 0 and automata.is_monitor[automata.owner[g]]:
            return UNDECIDED
    return found


@inlined
def take_fine_row(automata: Any, lin: Any, k: int, z: Any, continuous: bool, state: Any, work: Any) -> bool:
    """Take over the signs of the guards in the modes of row `k`, and return True, if these modes are admissible."""
    if row_verdict(automata, lin, k, z, work.everything, continuous, 0, work) != FINE:
        return False
    put(work.all_sides[0], state.sides)
    put(work.all_orders[0], state.orders)
    put(work.all_floors[0], state.floors)
    return True


@inline_always
def choose_modes(
    automata: Any, tapes: Any, inputs: Any, lin: Any, at: Any, k: int, is_known: bool, count: int, work: Any
) -> int:
    """Choose the modes of the first `count` components of a cluster, and write them to `trial`.

    Returns the number of the chosen candidate, or -1 if the outcome is not certain. at: the event; the states after it
    are `x_after`. k: row of the current modes, or -1 for no tapes; is_known: the series of their guards are in
    `judged`. `ROW` becomes that of the chosen modes.
    """
    members, candidates, trial, ranks = work.members, work.candidates, work.trial, work.ranks
    cluster = cluster_of(automata, members[0])
    total, chosen, score, found = SURFACE_MODES**count, NONE, NO_SCORE, LEAVES
    for number in range(total):
        rest = number
        for i in range(count - 1, -1, -1):
            candidates[number, i] = rest % SURFACE_MODES
            rest //= SURFACE_MODES
    rank_candidates(candidates, total, count, work.current, work.holds, work.keeps, ranks)
    for rank in range((count + 1) * (count + 1) - 1, -1, -1):
        if is_settled(score, rank, count):
            break
        for number in range(total):
            if ranks[number] != rank:
                continue
            for i in range(count):
                trial[members[i]] = candidates[number, i]
            row = k if is_current(rank, count) else row_of(tapes, trial, work)
            if row < 0:
                return -1
            if not (is_current(rank, count) and is_known):
                guard_series(tapes, inputs, lin, row, at, work.x_after, work.slopes, work)
            continuous = is_continuous(automata, at, trial, cluster, work)
            own = row_verdict(automata, lin, row, trial, cluster, continuous, number, work)
            chosen, score = joint_choice(chosen, score, number, rank, own, count)
            if chosen == number:
                found, work.int_slots[ROW] = own, row
    if chosen < 0 or found != FINE:
        return -1
    for i in range(count):
        trial[members[i]] = candidates[chosen, i]
    return chosen


@inline_always
def choose_surface_modes(
    automata: Any,
    tapes: Any,
    inputs: Any,
    lin: Any,
    state: Any,
    work: Any,
    fired: int,
    k: int,
    is_known: bool,
) -> int:
    """Choose admissible modes for the components that are at their surfaces, and write the modes to `work.trial`.

    Returns the number of that candidate, or -1 if the outcome is not certain. k: row of the modes before; is_known: the
    series of their guards at the event are in `judged`.
    """
    at, x, x_error, trial = located(state, work), work.x_after, work.slopes, work.trial
    members, hold = work.members, automata.hold
    c = automata.owner[fired]
    cluster = cluster_of(automata, c)
    count, is_intersection = 0, False
    put(at.z, trial)
    for i in range(cluster.shape[0]):
        d = cluster[i]
        if d == c or at.z[d] == hold[d]:
            if count == members.shape[0]:
                return -1
            members[count], work.current[count], work.holds[count] = d, at.z[d], hold[d]
            work.keeps[count] = d != c  # its guards are not zero: `is_alone`
            work.on_surface[d] = True
            is_intersection = is_intersection or automata.is_unique[d]
            trial[d] = hold[d]
            count += 1
    if is_intersection and count > 1:
        return -1
    call(called_by(work).project, at.s, at.x, at.p, trial, x)
    for i in range(count):
        held = automata.pin[members[i], 0]
        if held >= 0:  # a unilateral contact holds two states and is not ordinary
            x_error[held] = UNIT * abs(x[held])
    for i in range(x.shape[0]):
        is_known = is_known and x[i] == at.x[i] and x_error[i] == at.x_error[i]
    measure_point(lin, work)
    return choose_modes(automata, tapes, inputs, lin, at, k, is_known, count, work)
