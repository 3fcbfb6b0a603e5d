"""This module stores the banded matrices of a chain of blocks by their diagonals.

If each coordinate is a node with its own contact, and K and C have few diagonals (a chain of masses), series
are computed for eight neighbours at once: `hybridsim.mechanics.series_loop.banded_series`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.engine.native.simd.vectors import WIDTH

# rows: w; M^-1 w; 1/(w M^-1 w); base; acceleration; constants of laws
WEIGHT, MOBILITY, HOLDING, BASE, STILL, VALUES = range(6)
_FULL = 1 / 3  # least fraction of non-zero entries in the diagonals


def in_bands(
    K: Any, C: Any, B: Any, W: Any, single: bool, base: np.ndarray, still: np.ndarray, par: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the offsets of the diagonals of banded matrices, and the constants of nodes, law and diagonals.

    There are no offsets if the system is not of this kind. single: each coordinate is a node with one
    contact, nothing depends on time, and there is one law.
    """
    none = np.zeros(0, dtype=np.int64), np.zeros((1, WIDTH))
    if not single:
        return none
    damped = C.nnz > 0
    parts = [part.tocoo() for part in ((K, C) if damped else (K,))]
    offsets = np.unique(np.concatenate([part.col - part.row for part in parts])).astype(np.int64)
    n = K.shape[0]
    if not len(offsets) or sum(part.nnz for part in parts) < _FULL * n * len(offsets) * len(parts):
        return none
    w, b = W.diagonal(), B.diagonal()
    rows = [w, b, 1.0 / (w * b), base, still, *par.T]
    for part in parts:
        diagonals = np.zeros((len(offsets), n))
        diagonals[np.searchsorted(offsets, part.col - part.row), part.row] = part.data
        rows += list(diagonals)
    wide = -(-n // WIDTH) * WIDTH + WIDTH  # a run may begin anywhere
    out = np.zeros((len(rows), wide))
    out[:, :n] = rows
    out[VALUES : VALUES + par.shape[1], n:] = par[-1][:, None]  # a law needs valid constants there, too
    return offsets, out
