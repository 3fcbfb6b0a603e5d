"""This module looks up the row of a combination of modes in a hash table.

The table uses open addressing: a vector is stored at the first free slot after its hash, the number with its modes as
digits modulo the table size (D. E. Knuth, The Art of Computer Programming, vol. 3, 2nd ed. 1998, section 6.4,
algorithm L).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import inlined, kernel
from hybridsim.engine.native.loop_hints import short_loop

_SEARCHED = 32  # largest number of vectors with a linear search
_SLOTS_PER_VECTOR = 4  # least number of slots for each vector
_FREE = -1


@inlined
def _is_at(modes: Any, k: int, z: Any) -> bool:
    c = 0
    while c < z.shape[0] and modes[k, c] == z[c]:
        short_loop()
        c += 1
    return c == z.shape[0]


@inlined
def _first_place(z: Any, count: int) -> int:
    """Return the hash of a combination of modes: its number modulo a power of two."""
    number = 0
    for c in range(z.shape[0]):
        short_loop()
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
    """Return the hash table of different combinations of modes; -1 is a free slot."""
    if len(modes) <= _SEARCHED:
        return np.full(1, _FREE, dtype=np.int64)
    index = np.full(1 << (_SLOTS_PER_VECTOR * len(modes) - 1).bit_length(), _FREE, dtype=np.int64)
    _fill(modes, index)
    return index


@inlined
def find_modes(tapes: Any, z: Any) -> int:
    """Return the row of a combination of modes in the instruction tapes, or -1."""
    modes, index = tapes.modes, tapes.hash_slots
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
