"""The variational flow over one segment: Y' = A(t) Y + B(t) by Gauss collocation along the dense output.

Eight Gauss points a piece are of order 16 at its end (E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary
Differential Equations I, 2nd ed., 1993, section II.7); the equation is linear, so that each piece is one linear system.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.polynomial import legendre

_STAGES = 8
_RESOLVED = (
    1e-8  # last coefficients of the rates on a piece; the end of the piece is good to about their square
)
_TAIL = 2
_NOISE = 1e-5  # below that, what halving does not make smaller is rounding
_HALVINGS = 30
_CANCELS = (
    1e-5  # times _RESOLVED: a change of the states, in units of their sizes, of a few hundred roundings
)

_X, _W = legendre.leggauss(_STAGES)
NODES, _B = 0.5 * (1.0 + _X), 0.5 * _W
_COEFFICIENTS = np.linalg.inv(legendre.legvander(_X, _STAGES - 1))
# a_ij: integral from 0 to c_i of the j-th Lagrange polynomial
_A = np.array(
    [0.5 * (legendre.legval(_X, legendre.legint(column, lbnd=-1.0))) for column in _COEFFICIENTS.T]
).T

Slopes = Callable[[np.ndarray], np.ndarray]
"""Derivatives (m, n, n + q) of the rates at local times (m,): by the states, then by q things that stay constant."""


def transition(slopes: Slopes, knots: np.ndarray, scale: np.ndarray, constants: np.ndarray) -> np.ndarray:
    """d(states at the last knot)/d(states at the first, things that stay constant), (n, n + q).

    knots: local times, ascending, between which the flow is smooth. scale (n,), constants (q,): sizes of the states and
    of what stays constant, all above zero.
    """
    begins, ends = knots[:-1], knots[1:]
    pieces: list[tuple[np.ndarray, np.ndarray]] = []
    before = np.full(len(begins), np.inf)
    for halving in range(_HALVINGS):
        found, tails = _pieces(slopes, begins, ends, scale, constants)
        is_rounding = (tails <= _NOISE) & (tails >= 0.7 * before)
        good = (tails <= _RESOLVED) | is_rounding | (halving == _HALVINGS - 1)
        pieces.append((begins[good], found[good]))
        if good.all():
            break
        begins, ends, before = begins[~good], ends[~good], tails[~good]
        middle = 0.5 * (begins + ends)
        begins, ends = np.concatenate([begins, middle]), np.concatenate([middle, ends])
        before = np.concatenate([before, before])
    starts = np.concatenate([b for b, _ in pieces])
    matrices = np.concatenate([m for _, m in pieces])[np.argsort(starts, kind="stable")]
    n = matrices.shape[1]
    total = np.eye(n, matrices.shape[2])
    for matrix in matrices:
        total = matrix[:, :n] @ total
        total[:, n:] += matrix[:, n:]
    return total


def _pieces(
    slopes: Slopes, begins: np.ndarray, ends: np.ndarray, scale: np.ndarray, constants: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The transition (K, n, n + q) over each piece, and how well the rates are resolved on it (K,)."""
    lengths = ends - begins
    times = begins[:, None] + lengths[:, None] * NODES
    D = slopes(times.ravel())
    count, n, width = len(begins), D.shape[1], D.shape[2]
    D = D.reshape(count, _STAGES, n, width)
    A = D[..., :n]
    # K_i - h sum_j a_ij A_i K_j = A_i Y0 + B_i for the columns of Y
    system = -lengths[:, None, None, None, None] * np.einsum("ij,kiab->kiajb", _A, A)
    system = system.reshape(count, _STAGES * n, _STAGES * n) + np.eye(_STAGES * n)
    rates = np.linalg.solve(system, D.reshape(count, _STAGES * n, width)).reshape(count, _STAGES, n, width)
    moved = lengths[:, None, None] * np.einsum("i,kiab->kab", _B, rates)
    moved[:, :, :n] += np.eye(n)
    tails = np.abs(np.einsum("ci,kiab->kcab", _COEFFICIENTS[-_TAIL:], rates)).max(axis=1)
    tails *= lengths[:, None, None] / scale[:, None]
    sizes = np.abs(moved) / scale[:, None]
    sizes[:, :, :n] *= scale
    tails[:, :, :n] *= scale
    # the states by the states as one matrix without units; each of the constants by itself
    resolved = tails[:, :, :n].max(axis=(1, 2)) / sizes[:, :, :n].max(axis=(1, 2))
    others, largest = tails[:, :, n:].max(axis=1), sizes[:, :, n:].max(axis=1)
    # what a change of a constant by its own size does: below that it cancels, and rounding is left
    relative = others / np.maximum(largest, _CANCELS / constants)
    return moved, np.maximum(resolved, relative.max(axis=1, initial=0.0))
