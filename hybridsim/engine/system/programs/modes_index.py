"""Where a vector of modes is on a shelf: by a table of remainders once it is long, so that no event searches all of it.

Open addressing: a vector goes to the first free place from the one that its number, written with its modes as digits,
leaves as a remainder (D. E. Knuth, The Art of Computer Programming, vol. 3, 2nd ed. 1998, section 6.4, algorithm L).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import inlined, kernel
from hybridsim.engine.native.loop_hints import few

_SEARCHED = 32  # vectors of a shelf that is searched from one end to the other
_ROOM = 4  # places for each vector, at least
_FREE = -1


@inlined
def _is_at(modes: Any, k: int, z: Any) -> bool:
    c = 0
    while c < z.shape[0] and modes[k, c] == z[c]:
        few()
        c += 1
    return c == z.shape[0]


@inlined
def _first_place(z: Any, count: int) -> int:
    """The remainder of a vector's number, for a power of two."""
    number = 0
    for c in range(z.shape[0]):
        few()
        number = (31 * number + z[c]) & (count - 1)
    return number


@kernel
def _fill(modes: Any, index: Any) -> None:
    for k in range(modes.shape[0]):
        place = _first_place(modes[k], index.shape[0])
        while index[place] != _FREE:
            place = (place + 1) & (index.shape[0] - 1)
        index[place] = k


def index_of(modes: np.ndarray) -> np.ndarray:
    """The table of these vectors (K, components), no two alike: rows, or -1 where a place is free."""
    if len(modes) <= _SEARCHED:
        return np.full(1, _FREE, dtype=np.int64)
    index = np.full(1 << (_ROOM * len(modes) - 1).bit_length(), _FREE, dtype=np.int64)
    _fill(modes, index)
    return index


@inlined
def find_modes(tapes: Any, z: Any) -> int:
    """Row of a vector of modes on the shelf; -1 where it is not."""
    modes, index = tapes.modes, tapes.places
    if modes.shape[0] <= _SEARCHED:
        for k in range(modes.shape[0]):
            if _is_at(modes, k, z):
                return k
        return -1
    place = _first_place(z, index.shape[0])
    while index[place] != _FREE and not _is_at(modes, index[place], z):
        place = (place + 1) & (index.shape[0] - 1)
    found: int = index[place]
    return found
