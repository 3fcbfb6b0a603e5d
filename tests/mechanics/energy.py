"""The balance of energy of a run: work of forcing, of damping and of friction by quadrature against what is stored."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import leggauss

import hybridsim as hs


@dataclass(frozen=True)
class Balance:
    """Energies of a run: gained by what is stored, put in by the forces, lost in the dampers and at the contacts.

    friction is the work that the system does against the contacts, sum of f w.v; dissipated that of the relative
    velocities, sum of f (w.v - base), which is never negative: the difference is what moving bases put in.
    """

    gained: float
    forcing: float
    damping: float
    friction: float
    dissipated: float

    @property
    def miss(self) -> float:
        """What is left over, relative to what friction dissipates."""
        return abs(self.gained - self.forcing + self.damping + self.friction) / self.dissipated


def balance(sol: hs.Solution, order: int = 20) -> Balance:
    """Works over the whole run, by Gauss-Legendre quadrature of that order over each piece between two times."""
    system = sol.model
    M, C, K = (matrix.toarray() for matrix in (system.M, system.C, system.K))
    nodes, weights = leggauss(order)
    knots = np.unique(sol.t)
    half = 0.5 * np.diff(knots)
    t = (knots[:-1, None] + np.outer(half, nodes + 1.0)).ravel()
    weight = np.outer(half, weights).ravel()
    velocity = sol(t)[system.n :]
    force = np.zeros_like(velocity)
    for i, terms in system.forcing.items():
        for term in terms:
            force[i] += value(term, t)
    friction = dissipated = 0.0
    for contact in system.contacts:
        f = sol.output(contact.name, t)
        speed = sum(w * velocity[i] for i, w in contact.direction)
        friction += weight @ (f * speed)
        dissipated += weight @ (f * (speed - value(contact.base, t)))

    def energy(x: np.ndarray) -> float:
        q, v = np.split(x, 2)
        return float(0.5 * v @ (M @ v) + 0.5 * q @ (K @ q))

    return Balance(
        energy(sol(sol.t_end)) - energy(sol(sol.t_start)),
        float(weight @ (force * velocity).sum(axis=0)),
        float(weight @ (velocity * (C @ velocity)).sum(axis=0)),
        float(friction),
        float(dissipated),
    )


def value(term: float | hs.Harmonic, t: np.ndarray) -> np.ndarray:
    """A force, or the speed of a base, at times."""
    if isinstance(term, hs.Harmonic):
        return term.sin * np.sin(term.omega * t) + term.cos * np.cos(term.omega * t)
    return np.full_like(t, term)
