"""Random mechanical systems with coupled mass, stiffness and contacts, and what their classes are."""

from __future__ import annotations

import numpy as np

import hybridsim as hs

LAWS = {
    "coulomb": lambda rng: {"mu": rng.uniform(0.2, 0.6)},
    "static-kinetic": lambda rng: dict(zip(("mu_k", "mu_s"), np.sort(rng.uniform(0.2, 0.7, 2)), strict=True)),
    "hyperbolic": lambda rng: {"mu": rng.uniform(0.3, 0.7), "delta": rng.uniform(0.2, 2.0)},
}


def random_system(seed: int, law: str, most: int = 12) -> hs.MechanicalSystem:
    """Dense M and K, damping in proportion, belts and a forcing; directions of one, two or all coordinates."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, most + 1))
    A = rng.normal(size=(n, n)) / np.sqrt(n)
    M = np.diag(rng.uniform(0.5, 2.0, n)) + 0.3 * A @ A.T
    A = rng.normal(size=(n, n)) / np.sqrt(n)
    K = np.diag(rng.uniform(1.0, 3.0, n)) + A @ A.T
    contacts = []
    for i in range(int(rng.integers(2, min(n, 5) + 1))):
        w = np.zeros(n)
        kind = rng.integers(3)
        chosen = rng.permutation(n)
        if kind == 0:
            w[chosen[0]] = 1.0
        elif kind == 1:
            w[chosen[0]], w[chosen[1]] = 1.0, -1.0
        else:
            w[:] = rng.normal(size=n)
        base = float(rng.choice([0.0, 0.2, -0.3]))
        contacts.append(
            hs.MechanicalContact(f"f{i + 1}", w, rng.uniform(0.3, 1.0), law, LAWS[law](rng), base=base)
        )
    forcing = {0: hs.Harmonic(rng.uniform(0.5, 2.0), sin=rng.uniform(0.5, 2.0)), n - 1: 0.3}
    return hs.MechanicalSystem(
        M, 0.03 * K, K, forcing, contacts, q0=rng.normal(size=n), v0=rng.normal(size=n)
    )


def reordered(system: hs.MechanicalSystem, seed: int) -> tuple[hs.MechanicalSystem, np.ndarray]:
    """The same with coordinates and contacts in another order; new coordinate -> old."""
    rng = np.random.default_rng(seed)
    dofs, contacts = rng.permutation(system.n), rng.permutation(len(system.contacts))
    place = np.argsort(dofs)
    moved = [
        hs.MechanicalContact(
            c.name, {int(place[i]): w for i, w in c.direction}, c.normal, c.law, c.arguments, c.base
        )
        for c in (system.contacts[k] for k in contacts)
    ]
    dense = [matrix.toarray()[np.ix_(dofs, dofs)] for matrix in (system.M, system.C, system.K)]
    forcing = {int(place[i]): terms for i, terms in system.forcing.items()}
    return hs.MechanicalSystem(*dense, forcing, moved, q0=system.q0[dofs], v0=system.v0[dofs]), dofs
