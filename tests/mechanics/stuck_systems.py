"""Contacts over several coordinates that stick for ever, and by how many ulp they miss their constraints."""

from __future__ import annotations

import numpy as np

import hybridsim as hs

FORCING = 1.3  # rad per unit of time, the faster of the two forcings


def stuck_system(base: float = 0.0) -> hs.MechanicalSystem:
    """Two contacts with directions over all of three coordinates: one way to move is left, and shaken."""
    rng = np.random.default_rng(0)
    W = rng.normal(size=(2, 3))
    contacts = [
        hs.MechanicalContact(f"f{i}", W[i], 50.0, "coulomb", {"mu": 0.9}, base=base * (1 - 2 * i))
        for i in range(2)
    ]
    mass = np.eye(3) + 0.2 * W.T @ W
    forcing = [hs.Harmonic(FORCING, sin=0.5), 0, hs.Harmonic(0.7, sin=0.5)]
    # on moving bases the springs would tear the contacts loose in time: dashpots alone
    stiffness = [1.0] * 3 if base == 0.0 else None
    start = np.linalg.pinv(W) @ [base, -base]
    return hs.MechanicalSystem(mass, [0.1] * 3, stiffness, forcing, contacts, v0=start)


def ulps_off(system: hs.MechanicalSystem, states: np.ndarray) -> float:
    """Largest abs(w.v - base) over the ulp of the sum of abs(w_i v_i) and abs(base); states (2n, k)."""
    worst = 0.0
    for contact in system.contacts:
        terms = np.array(
            [w * states[system.n + i] for i, w in contact.direction]
            + [np.full(states.shape[1], -contact.base)]
        )
        worst = max(worst, float((abs(terms.sum(axis=0)) / np.spacing(abs(terms).sum(axis=0))).max()))
    return worst
