"""At a gap of zero without a velocity, friction along the gap sticks where the contact is closed, and only there."""

from __future__ import annotations

import numpy as np

from hybridsim.engine.system.system import System


def with_tied(system: System, members: list[int]) -> list[int]:
    """Components that are decided together, and the contacts along the gaps among them: these rest as well."""
    tied = {along for gap, along, is_one in system.ties if is_one and gap in members}
    return sorted(tied.union(members))


def together(system: System, members: list[int], candidates: np.ndarray) -> np.ndarray:
    """The candidates (k, members) in which a gap and a contact along it hold both or neither.

    Where they have different velocities (a stop beside a belt) they never hold both.
    """
    keep = np.ones(len(candidates), dtype=np.bool_)
    for gap, along, is_one in system.ties:
        if gap in members and along in members:
            a, b = (candidates[:, members.index(c)] == system.automata[c].hold for c in (gap, along))
            keep &= (a == b) if is_one else ~(a & b)
    return candidates[keep]
