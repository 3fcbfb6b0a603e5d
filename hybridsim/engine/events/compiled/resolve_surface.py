"""Resolve events at surfaces in compiled loops: find the modes of a cluster that are admissible just after."""

from __future__ import annotations

from typing import Any

from hybridsim.engine.events.choice.verdict import FINE, LEAVES, NONE, NONUNIQUE, choose, preference
from hybridsim.engine.events.compiled.scratch import called_by, located
from hybridsim.engine.events.compiled.verdicts import UNKNOWN, candidate_verdict, certainly_leaves, cluster_of
from hybridsim.engine.native.kernels import call, call_noinline, inline_always
from hybridsim.engine.native.loop_hints import put
from hybridsim.engine.series.bounded import UNIT


@inline_always
def choose_single_mode(
    automata: Any,
    tapes: Any,
    inputs: Any,
    lin: Any,
    state: Any,
    work: Any,
    fired: int,
    k: int,
    is_known: bool,
    c: int,
) -> int:
    """Choose the mode of one component at its surface by testing its three modes one by one."""
    z, trial = work.z_after, work.trial
    now, hold = z[c], automata.hold[c]
    if not certainly_leaves(automata, lin, k, z, fired, is_known, work.x_after, work.slopes, work):
        trial[c] = now
        verdict = call_noinline(
            candidate_verdict, (automata, tapes, inputs, lin, state, work, fired, is_known, c, now)
        )
        if verdict != LEAVES:
            return now if verdict == FINE else -1
    if now != hold:
        for mode in (hold, 3 - hold - now):
            trial[c] = mode
            verdict = call_noinline(
                candidate_verdict, (automata, tapes, inputs, lin, state, work, fired, False, c, mode)
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
        verdict = call_noinline(
            candidate_verdict, (automata, tapes, inputs, lin, state, work, fired, False, c, mode)
        )
        if verdict == LEAVES:
            continue
        if verdict != FINE or found >= 0:
            return -1
        found = mode
    if found >= 0:
        z[c] = found
    return found


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
    """Write the admissible modes of the components of a cluster at their surfaces to `work.z_after`.

    Returns the number of that candidate, or -1 if the outcome is not certain. Candidates are tried in the order of
    preference of `choose`, up to the first accepted one. k: row of the modes before; is_known: whether the series of
    their guards are in the work space.
    """
    at, x, x_error, z = located(state, work), work.x_after, work.slopes, work.z_after
    members, trial, candidates, verdicts = work.members, work.trial, work.candidates, work.verdicts
    hold, pin, current, holds = automata.hold, automata.pin, work.current, work.holds
    ranks = work.ranks
    c = automata.owner[fired]
    cluster = cluster_of(automata, c)
    count, is_intersection = 0, False
    for i in range(cluster.shape[0]):
        d = cluster[i]
        if d == c or z[d] == hold[d]:
            if count == members.shape[0]:
                return -1
            members[count], current[count], holds[count] = d, z[d], hold[d]
            count += 1
            work.on_surface[d] = True
            is_intersection = is_intersection or automata.is_unique[d]
    if is_intersection and count > 1:
        return -1
    put(z, trial)
    for i in range(count):
        trial[members[i]] = hold[members[i]]
    call(called_by(work).project, at.s, at.x, at.p, trial, x)
    for i in range(count):
        if pin[members[i], 0] >= 0:  # a unilateral contact holds two states and is not ordinary
            x_error[pin[members[i], 0]] = UNIT * abs(x[pin[members[i], 0]])
    for i in range(x.shape[0]):
        is_known = is_known and x[i] == at.x[i] and x_error[i] == at.x_error[i]
    if count == 1:
        return choose_single_mode(automata, tapes, inputs, lin, state, work, fired, k, is_known, members[0])
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
            # a contact below its limits has no cause to release: `hybridsim.engine.events.choice.uniqueness`
            is_caused = True
            for i in range(count):
                trial[members[i]] = candidates[number, i]
                is_caused = is_caused and (members[i] == c or candidates[number, i] == holds[i])
            if not is_caused:
                continue
            is_current = rank >= (count + 1) * count
            if is_current and certainly_leaves(automata, lin, k, z, fired, is_known, x, x_error, work):
                continue
            verdict = call_noinline(
                candidate_verdict,
                (automata, tapes, inputs, lin, state, work, fired, is_current and is_known, c, number),
            )
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
