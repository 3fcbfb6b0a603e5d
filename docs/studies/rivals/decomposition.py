"""The matrices of the scene with two masses, decomposed once for each pattern of stick."""

from __future__ import annotations

import numpy as np


def full_matrix(p: dict[str, float]) -> np.ndarray:
    """The full system x' = A x + ..., without friction."""
    c, k, kc = p["c"], p["k"], p["kc"]
    return np.array([[0, 1, 0, 0], [-(k + kc), -c, kc, 0], [0, 0, 0, 1], [kc, 0, -(k + kc), -c]], dtype=float)


def decomposed(full: np.ndarray, F0: float, w: float) -> tuple[np.ndarray, ...]:
    """Per pattern (bit j: mass j is held): eigenvalues, vectors, their inverse, and the responses.

    A held mass has no rates: its velocity is zero, and its place acts on the other as a constant. So every pattern is
    x' = B x + constant friction + drive, with the rows of held masses zero. The two phasors with a positive imaginary
    part are kept, twice their real part is the sum; what is zero is constant.
    """
    rates, vectors, inverses, centres, responses = [], [], [], [], []
    for pattern in range(4):
        free = [j for j in (0, 1) if not pattern >> j & 1]
        index = [i for j in free for i in (2 * j, 2 * j + 1)]
        held = [2 * j for j in (0, 1) if j not in free]
        lam, vec = np.zeros(2, dtype=complex), np.zeros((4, 2), dtype=complex)
        inv, centre = np.zeros((2, 4), dtype=complex), np.zeros((4, 4))
        response = np.zeros(4, dtype=complex)
        if free:
            block = full[np.ix_(index, index)]
            values, right = np.linalg.eig(block)
            upper = [i for i in range(len(values)) if values[i].imag > 0]
            left = np.linalg.inv(right)
            for slot, i in enumerate(upper):
                lam[slot], vec[index, slot], inv[slot, index] = values[i], right[:, i], left[i]
            # at rest: block centre = -(what held masses and friction put in); columns: places held, friction forces
            inside = -np.linalg.inv(block)
            for column in held:
                centre[index, column] = inside @ full[index, column]
            for j in free:
                push = np.zeros(len(index))
                push[index.index(2 * j + 1)] = -1.0
                centre[index, 2 * j + 1] = inside @ push
            drive = np.zeros(len(index), dtype=complex)
            if 0 in free:
                drive[index.index(1)] = F0
            response[index] = np.linalg.solve(1j * w * np.eye(len(index)) - block, drive)
        rates.append(lam)
        vectors.append(vec)
        inverses.append(inv)
        centres.append(centre)
        responses.append(response)
    return tuple(np.array(rows) for rows in (rates, vectors, inverses, centres, responses))
