"""Where switching surfaces meet: whether one motion alone is admissible, and whether the surfaces keep it.

On k surfaces at once ds/dt = a + B u with u in [-1, 1]^k. Where all principal minors of -B are positive (a P-matrix), one
choice of u, among the corners, edges and the inside of that cube, is consistent whatever a is (Cottle, Pang and Stone,
The Linear Complementarity Problem, SIAM, 2009, doi:10.1137/1.9780898719000), and what slides stays on the surfaces.
Surfaces to which all fields point (nodal attractivity) are among these, and so are those that are spiralled into. Where
it is not so, a motion that slides along several surfaces is one of many.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.engine.decide import FINE
from hybridsim.engine.jets import UNIT

if TYPE_CHECKING:
    from hybridsim.engine.settle import Settling


def rivals(settling: Settling, members: list[int], candidates: np.ndarray, verdicts: np.ndarray) -> np.ndarray:
    """The admissible joint candidates, where they differ in the mode of a switching surface; else none."""
    unique = [k for k, c in enumerate(members) if settling.system.automata[c].is_unique]
    fine = candidates[verdicts == FINE]
    return fine if len(np.unique(fine[:, unique], axis=0)) > 1 else fine[:0]


def keeps_nothing(settling: Settling, members: list[int], z: np.ndarray) -> str:
    """Why a motion that slides along several surfaces may not be the only one; empty where it is."""
    automata = settling.system.automata
    sliding = [c for c in members if automata[c].is_unique and z[c] == automata[c].hold]
    if len(sliding) < 2:
        return ""
    pull = _pull(settling, sliding, z)
    for size in range(1, len(sliding) + 1):
        for chosen in combinations(range(len(sliding)), size):
            block = pull[np.ix_(chosen, chosen)]
            largest = float(np.prod(np.abs(block).sum(axis=1)))  # no minor is above this
            if not np.linalg.det(block) > 8.0 * size * UNIT * largest:
                names = " and ".join(automata[sliding[i]].name for i in chosen)
                return (
                    f"the surfaces {names} do not keep a motion that slides along both: it is one of many"
                    if size > 1
                    else f"the surface {names} does not attract where others are slid along"
                )
    return ""


def _pull(settling: Settling, sliding: list[int], z: np.ndarray) -> np.ndarray:
    """-B: by how much the rate of each surface falls from one side of each to the other."""
    automata, order = settling.system.automata, settling.system.surface_of
    rows = [order.index(c) for c in sliding]
    found = np.empty((len(sliding), len(sliding)))
    trial = z.copy()
    trial[sliding] = [automata[c].above for c in sliding]
    for j, c in enumerate(sliding):
        rates = []
        for side in (automata[c].below, automata[c].above):
            other = trial.copy()
            other[c] = side
            series: Any = settling.series_of(other)
            rates.append(series.surfaces[rows, 1])
        found[:, j] = 0.5 * (rates[0] - rates[1])
    return found


def words_on(settling: Settling, members: list[int]) -> str:
    """What to know of the switching surfaces that no motion could be decided at; empty where there is nothing."""
    system = settling.system
    held = {*system.pins, *system.projected}
    slow = [system.automata[c].name for c in members if system.automata[c].is_unique and c not in held]
    if not slow:
        return ""
    return (
        f"; {', '.join(slow)} acts on higher derivatives of its switching function alone, so that sliding along it is of "
        "a higher order, which is not followed"
    )
