"""This module computes the energy that a mechanical system receives from each source during a Taylor run."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from hybridsim.mechanics.arrays_trajectory import ArraysTrajectory
from hybridsim.mechanics.declaration.system import Harmonic
from hybridsim.solution.integrals.quadrature import integral

SOURCES = ("forcing", "damping", "friction", "bases", "impacts")


def work_by_source(run: ArraysTrajectory) -> dict[str, float]:
    """Return the work of the forcing, the damping, the friction, the moving bases and the impacts on a system.

    ::

        v . F,    - v . C v,    - sum of f v_rel,    - sum of f base

    are integrated over the run. A Taylor run has no impacts.
    """
    system = run.model

    def powers(times: np.ndarray) -> np.ndarray:
        v = run.states(times, "+")[:, system.n :]
        forces, velocities = run.forces_and_velocities(times)
        bases = [signal([contact.base], times) for contact in system.contacts]
        return np.column_stack(
            [
                sum(
                    (v[:, i] * signal(terms, times) for i, terms in system.forcing.items()),
                    np.zeros(len(times)),
                ),
                -(v * (system.C @ v.T).T).sum(axis=1),
                -(forces * velocities).sum(axis=1),
                -(forces * np.reshape(bases, forces.T.shape).T).sum(axis=1),
                np.zeros(len(times)),
            ]
        )

    run.require_states()
    found = integral(powers, np.unique(run.own_times), len(SOURCES))
    return dict(zip(SOURCES, found.tolist(), strict=True))


def signal(terms: Iterable[float | Harmonic], times: np.ndarray) -> np.ndarray:
    """Return the sum (k,) of constants and harmonics at times (k,)."""
    found = np.zeros(len(times))
    for term in terms:
        if isinstance(term, Harmonic):
            found += term.sin * np.sin(term.omega * times) + term.cos * np.cos(term.omega * times)
        else:
            found += term
    return found
