"""This module estimates from forces and stiffnesses how large the motion of a structure can be."""

from __future__ import annotations

import math

import numpy as np

from hybridsim.mechanics.declaration.system import MechanicalSystem
from hybridsim.mechanics.series_loop.mechanical_arrays import Built

FLOOR = 1e-3  # smallest scale of a state, relative to the largest scale of its kind or to its own size


def natural_sizes(system: MechanicalSystem, built: Built, period: float) -> np.ndarray:
    """Return the sizes (2n,) that positions and velocities would have under the same forces without contacts.

    A force f on a mass m with stiffness k and damping c causes a displacement of about f / (m w^2 + c w + k) at
    the angular frequency w of the period. Coupling is ignored, but no size is below the floor of `with_floor`.
    A contact with a moving base pushes with its limit of stick. Sizes of a system without forces are zero.
    """
    arrays, omega = built.arrays, 2.0 * math.pi / period
    n = len(arrays.dof_node)
    rows = {name: np.repeat(np.arange(n), np.diff(getattr(arrays, name + "_ptr"))) for name in "hkcb"}
    push = np.abs(arrays.still)
    np.add.at(push, rows["h"], np.abs(arrays.h_val).sum(axis=1))
    pushes = np.where(np.abs(arrays.base).any(axis=1), arrays.limits.max(axis=1, initial=0.0), 0.0)
    np.add.at(push, rows["b"], np.abs(arrays.b_val) * pushes[arrays.b_col])
    resistance = np.full(n, omega**2)
    for name, factor, col, val in (
        ("k", 1.0, arrays.k_col, arrays.k_val), ("c", omega, arrays.c_col, arrays.c_val),
    ):  # fmt: skip
        own = col == rows[name]
        np.add.at(resistance, rows[name][own], factor * np.abs(val[own]))
    positions = push / resistance
    return with_floor(np.concatenate([positions, omega * positions]), masses_of(system, built))


def masses_of(system: MechanicalSystem, built: Built) -> np.ndarray:
    """Return the diagonal (n,) of the mass matrix, in the order of the arrays."""
    return np.asarray(system.M.diagonal())[built.dofs]


def with_floor(scale: np.ndarray, masses: np.ndarray, fraction: float = FLOOR) -> np.ndarray:
    """Raise small scales (2n,) to a fraction of the largest scale of all positions, or of all velocities.

    Coordinates with different units are compared by the square root of their mass times their scale.
    """
    roots = np.sqrt(masses)
    parts = [np.maximum(part, fraction * (roots * part).max() / roots) for part in np.split(scale, 2)]
    return np.concatenate(parts)
