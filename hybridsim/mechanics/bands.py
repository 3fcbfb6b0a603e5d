"""The matrices of blocks that stand in a row, by their diagonals.

Where each coordinate is a node with a contact of its own, and K and C have few diagonals (a chain, a row of masses),
series are worked out for eight neighbours at once: `hybridsim.mechanics.runs`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.engine.eight import WIDTH

# rows: w; M^-1 w; 1/(w M^-1 w); base; acceleration; constants of laws
WEIGHT, MOBILITY, HOLDING, BASE, STILL, VALUES = range(6)
_FULL = 1 / 3  # of the entries of the diagonals, that are not zero at the least


def in_bands(
    K: Any, C: Any, B: Any, W: Any, single: bool, base: np.ndarray, still: np.ndarray, par: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Offsets of the diagonals, and rows: those named above, constants of the laws, diagonals of K, those of C if any.

    No offsets where the system is not of this kind. single: each coordinate is a node with one contact; nothing
    depends on time; there is one law.
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
    out[VALUES : VALUES + par.shape[1], n:] = par[-1][:, None]  # a law has a value there, too
    return offsets, out
