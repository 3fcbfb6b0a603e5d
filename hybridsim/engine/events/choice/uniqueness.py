"""Discard combinations of modes in which a contact slips below its limit force; check that the motion is unique.

Static friction above kinetic friction makes several combinations admissible: if one contact releases, the force on
another jumps. A contact below its limit has no cause to release unless the other contacts leave no alternative, as in
`hybridsim.mechanics.series_loop.decision`. Friction that is loaded by a reaction may have several admissible motions by
itself (P. Painleve, C. R. Acad. Sci. Paris 121 (1895) 112), and no rule prefers one of them.
"""

from __future__ import annotations

import numpy as np

from hybridsim.engine.events.choice.candidates import all_verdicts
from hybridsim.engine.events.choice.event_verdicts import EventVerdicts
from hybridsim.engine.events.choice.joint_choice import is_below_limit
from hybridsim.engine.events.choice.surface_intersection import is_one_motion
from hybridsim.engine.events.choice.verdict import FINE
from hybridsim.engine.native.kernels import Precompiled

# Largest number of components at their surfaces whose other outcomes are examined; 3^5 verdicts would be too slow.
MAX_JOINT_COMPONENTS = 4

_is_below_limit = Precompiled(is_below_limit)


def below_limits(resolution: EventVerdicts, members: list[int]) -> np.ndarray:
    """Return a mask of the contacts whose forces are certainly below their limits; single ones are not tested."""
    automata, at = resolution.system.automata, resolution.at
    modes, keeps = np.maximum(at.z, 0), np.zeros(len(members), dtype=np.bool_)
    holding = [
        k
        for k, c in enumerate(members)
        if at.z[c] in (-1, automata[c].hold) and not (automata[c].is_unilateral or automata[c].is_unique)
    ]
    if not holding or len(members) == 1:
        return keeps
    begun = [members[k] for k in holding]
    modes[begun] = [automata[c].hold for c in begun]  # at a start, a contact on its surface sticks if it can
    event = resolution.judged(modes)
    for k in holding:
        keeps[k] = _is_below_limit(resolution.automata, event, members[k])
    return keeps


def other_outcomes(
    resolution: EventVerdicts,
    members: list[int],
    candidates: np.ndarray,
    number: int,
    open_: set[int],
    cluster: tuple[int, ...],
) -> np.ndarray:
    """Return admissible candidates that differ in motion from the chosen one because a gap opens.

    Contacts that keep their mode are not examined, because the present mode stays if it is admissible.
    """
    system, at, taken = resolution.system, resolution.at, candidates[number]
    automata = system.automata
    if all(automata[c].is_unilateral for c in cluster):
        return candidates[:0]
    landed = {one.component for one in resolution.changes if one.guard == "gap"}
    asked = [
        k
        for k, c in enumerate(members)
        if automata[c].is_unilateral and c in open_ and (at.z[c] < 0 or c in landed or at.z[c] != taken[k])
    ]
    if not asked:
        return candidates[:0]
    if len(members) > MAX_JOINT_COMPONENTS:
        names = ", ".join(automata[c].name for c in members)
        resolution.warnings.append(
            f"more than {MAX_JOINT_COMPONENTS} components ({names}) change mode together: uniqueness was not examined"
        )
        return candidates[:0]
    others = candidates[(candidates[:, asked] != taken[asked]).any(axis=1)]
    fine = others[all_verdicts(resolution, members, others, cluster) == FINE]
    apart = [one for one in fine if not is_one_motion(resolution, members, np.array([taken, one]))]
    return np.array(apart, dtype=np.int64).reshape(-1, len(members))
