"""Let friction along a closed gap stick exactly if the gap is closed without velocity."""

from __future__ import annotations

import numpy as np

from hybridsim.engine.system.system import System


def with_tied(system: System, members: list[int]) -> list[int]:
    """Return the components that are decided together, with the friction contacts along their gaps."""
    tied = {along for gap, along, is_one in system.stop_couplings if is_one and gap in members}
    return sorted(tied.union(members))


def together(system: System, members: list[int], candidates: np.ndarray) -> np.ndarray:
    """Return the candidates in which a gap and the friction along it are both held, or neither is held.

    If their velocities differ (a stop beside a belt), candidates in which both hold are removed.
    """
    is_allowed = np.ones(len(candidates), dtype=np.bool_)
    for gap, along, is_one in system.stop_couplings:
        if gap in members and along in members:
            a, b = (candidates[:, members.index(c)] == system.automata[c].hold for c in (gap, along))
            is_allowed &= (a == b) if is_one else ~(a & b)
    return candidates[is_allowed]
