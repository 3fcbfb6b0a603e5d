"""Let friction along a gap stick exactly when the contact is closed, if the gap is zero without velocity."""

from __future__ import annotations

import numpy as np

from hybridsim.engine.system.system import System


def with_tied(system: System, members: list[int]) -> list[int]:
    """Return components that are decided together, with the contacts along the gaps among them."""
    tied = {along for gap, along, is_one in system.stop_couplings if is_one and gap in members}
    return sorted(tied.union(members))


def together(system: System, members: list[int], candidates: np.ndarray) -> np.ndarray:
    """Return the candidates (k, members) in which a gap and a contact along it both hold, or neither.

    If their velocities differ (a stop beside a belt), candidates in which both hold are removed.
    """
    is_allowed = np.ones(len(candidates), dtype=np.bool_)
    for gap, along, is_one in system.stop_couplings:
        if gap in members and along in members:
            a, b = (candidates[:, members.index(c)] == system.automata[c].hold for c in (gap, along))
            is_allowed &= (a == b) if is_one else ~(a & b)
    return candidates[is_allowed]
