"""The admissible sets of sticking and slipping contacts after an event, found by trying them all in 40 digits.

Another route than the engine's: no Delassus operator, no pivoting, no short series, but the whole system of
accelerations and forces [[M, W_S^T], [W_S, 0]] solved in mpmath for each combination, and for the two
derivatives after it.
"""

from __future__ import annotations

from itertools import product

import mpmath as mp
import numpy as np
from scipy.optimize import linprog

import hybridsim as hs

DIGITS = 40
NEAR = 1e-9  # what a double leaves of a zero, in units of the forces and accelerations, which are about one
RESTS = 1e-12  # the same of a velocity


def slip_series(contact: hs.MechanicalContact, v: mp.mpf, sign: int) -> list[mp.mpf]:
    """Force and its first two derivatives with respect to v, at v on the side `sign`."""
    values, N = {k: mp.mpf(x) for k, x in contact.values().items()}, mp.mpf(contact.normal)
    if contact.law.name == "coulomb":
        return [sign * values["mu"] * N, mp.mpf(0), mp.mpf(0)]
    if contact.law.name == "static-kinetic":
        return [sign * values["mu_k"] * N, mp.mpf(0), mp.mpf(0)]
    mu, d = values["mu"], values["delta"]
    u = 1 + d * sign * v
    return [sign * mu * N / u, -mu * N * d / u**2, sign * 2 * mu * N * d**2 / u**3]


def limit(contact: hs.MechanicalContact) -> mp.mpf:
    values = contact.values()
    return mp.mpf(values.get("mu_s", values.get("mu"))) * mp.mpf(contact.normal)


class Enumeration:
    """All candidates at one instant."""

    def __init__(self, system: hs.MechanicalSystem) -> None:
        self.system, self.n, self.m = system, system.n, len(system.contacts)
        self.M, self.C, self.K = (matrix.toarray() for matrix in (system.M, system.C, system.K))
        self.W = np.zeros((self.m, self.n))
        for c, contact in enumerate(system.contacts):
            for i, w in contact.direction:
                self.W[c, i] += w

    def forcing(self, t: float) -> list[mp.matrix]:
        """Forcing and its first two derivatives."""
        out = [mp.zeros(self.n, 1) for _ in range(3)]
        for i, terms in self.system.forcing.items():
            for term in terms:
                if isinstance(term, hs.Harmonic):
                    w, t_ = mp.mpf(term.omega), mp.mpf(t)
                    s, c = mp.mpf(term.sin), mp.mpf(term.cos)
                    for k in range(3):
                        angle = w * t_ + k * mp.pi / 2
                        out[k][i] += w**k * (s * mp.sin(angle) + c * mp.cos(angle))
                else:
                    out[0][i] += mp.mpf(term)
        return out

    def admissible(
        self, t: float, q: np.ndarray, v: np.ndarray
    ) -> tuple[list[int], list[tuple[int, ...]], list[int]]:
        """Contacts at rest; how these move just after by each admissible candidate; modes of the others."""
        with mp.workdps(DIGITS):
            relative = [
                mp.fsum(mp.mpf(w) * mp.mpf(x) for w, x in zip(self.W[c], v, strict=True))
                - mp.mpf(self.system.contacts[c].base)
                for c in range(self.m)
            ]
            at_rest = [c for c in range(self.m) if abs(relative[c]) < RESTS]
            others = [0 if c in at_rest else (1 if relative[c] > 0 else -1) for c in range(self.m)]
            force = self.forcing(t)
            found = []
            for trial in product((0, 1, -1), repeat=len(at_rest)):
                modes = list(others)
                for c, mode in zip(at_rest, trial, strict=True):
                    modes[c] = mode
                stuck = [c for c in range(self.m) if modes[c] == 0]
                if len(stuck) > 1 and np.linalg.matrix_rank(self.W[stuck], tol=1e-9) < len(stuck):
                    motion = self._redundant(modes, stuck, at_rest, relative, force[0], q, v)
                    if motion is not None and motion not in found:
                        found.append(motion)
                    continue
                if not self._is_plausible(modes, at_rest, relative, force[0], q, v):
                    continue
                motion = self._motion(
                    modes, at_rest, relative, force, mp.matrix(q.tolist()), mp.matrix(v.tolist())
                )
                if motion is not None and motion not in found:
                    found.append(motion)
            return at_rest, found, others

    def _is_plausible(self, modes, at_rest, relative, force, q, v) -> bool:
        """Whether accelerations in doubles speak clearly against a candidate: spares most of the work in 40 digits."""
        stuck = [c for c in range(self.m) if modes[c] == 0]
        A = np.block([[self.M, self.W[stuck].T], [self.W[stuck], np.zeros((len(stuck), len(stuck)))]])
        right = np.array([float(x) for x in force]) - self.C @ v - self.K @ q
        for c in range(self.m):
            if modes[c] != 0:
                speed = mp.mpf(0) if c in at_rest else relative[c]
                right -= self.W[c] * float(slip_series(self.system.contacts[c], speed, modes[c])[0])
        x = np.linalg.solve(A, np.concatenate([right, np.zeros(len(stuck))]))
        a, forces = self.W @ x[: self.n], dict(zip(stuck, x[self.n :], strict=True))
        return all(
            abs(forces[c]) <= float(limit(self.system.contacts[c])) + 1e-6
            if modes[c] == 0
            else modes[c] * a[c] >= -1e-6
            for c in at_rest
        )

    def _redundant(self, modes, stuck, at_rest, relative, force, q, v) -> tuple[int, ...] | None:
        """The motion where more stick than needed: forces within the limits must exist, a linear program."""
        right = np.array([float(x) for x in force]) - self.C @ v - self.K @ q
        for c in range(self.m):
            if modes[c] != 0:
                speed = mp.mpf(0) if c in at_rest else relative[c]
                right -= self.W[c] * float(slip_series(self.system.contacts[c], speed, modes[c])[0])
        inverse = np.linalg.inv(self.M)
        G, g = self.W[stuck] @ inverse @ self.W[stuck].T, self.W[stuck] @ inverse @ right
        bounds = [
            (-float(limit(self.system.contacts[c])), float(limit(self.system.contacts[c]))) for c in stuck
        ]
        U, values, _ = np.linalg.svd(G)
        span = U[:, values > 1e-9 * values[0]].T  # the equations that are independent
        solved = linprog(np.zeros(len(stuck)), A_eq=span @ G, b_eq=span @ g, bounds=bounds)
        if not solved.success:
            return None
        a = self.W @ inverse @ (right - self.W[stuck].T @ solved.x)
        if any(modes[c] * a[c] < -NEAR for c in at_rest):
            return None
        return tuple(modes[c] if abs(a[c]) > NEAR else 0 for c in at_rest)

    def _motion(self, modes, at_rest, relative, force, q, v) -> tuple[int, ...] | None:
        """How the contacts at rest move just after, 0 where they do not; None where the candidate is not admissible."""
        stuck = [c for c in range(self.m) if modes[c] == 0]
        size = self.n + len(stuck)
        A = mp.zeros(size, size)
        for i in range(self.n):
            for j in range(self.n):
                A[i, j] = mp.mpf(self.M[i, j])
        for k, c in enumerate(stuck):
            for i in range(self.n):
                A[i, self.n + k] = A[self.n + k, i] = mp.mpf(self.W[c, i])
        motion, forces = [q, v], [dict.fromkeys(range(self.m), mp.mpf(0)) for _ in range(3)]
        K, C = mp.matrix(self.K.tolist()), mp.matrix(self.C.tolist())
        W = mp.matrix(self.W.tolist())
        laws = {}
        for c in range(self.m):
            if modes[c] != 0:
                speed = mp.mpf(0) if c in at_rest else relative[c]
                laws[c] = slip_series(self.system.contacts[c], speed, modes[c])
        rel = []  # relative accelerations, and so on
        for order in range(3):
            right = force[order] - C * motion[order + 1] - K * motion[order]
            for c, (f, f1, f2) in laws.items():
                if order == 0:
                    forces[0][c] = f
                elif order == 1:
                    forces[1][c] = f1 * rel[0][c]
                else:
                    forces[2][c] = f1 * rel[1][c] + f2 * rel[0][c] ** 2
                for i in range(self.n):
                    right[i] -= W[c, i] * forces[order][c]
            b = mp.zeros(size, 1)
            for i in range(self.n):
                b[i] = right[i]
            x = mp.lu_solve(A, b)
            motion.append(x[: self.n])
            for k, c in enumerate(stuck):
                forces[order][c] = x[self.n + k]
            rel.append(W * motion[-1])
        for c in at_rest:
            if modes[c] == 0:
                most = limit(self.system.contacts[c])
                for sign in (1, -1):
                    if not _rises([most - sign * forces[0][c], -sign * forces[1][c], -sign * forces[2][c]]):
                        return None
            elif not _rises([modes[c] * rel[k][c] for k in range(3)]):
                return None
        return tuple(modes[c] if any(abs(rel[k][c]) > NEAR for k in range(3)) else 0 for c in at_rest)


def _rises(series) -> bool:
    """Whether the first that is not zero is positive."""
    for value in series:
        if abs(value) > NEAR:
            return value > 0
    return True
