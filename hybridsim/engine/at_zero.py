"""Surfaces that are at zero within rounding although nothing was located there: what may leave with another."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from hybridsim.engine.settle import Settling


def at_zero(settling: Settling, cluster: tuple[int, ...]) -> set[int]:
    """Components of a cluster on their surfaces to rounding.

    A surface that stays at zero while another component holds its function still (a contact that sticks where a relay
    switches on the speed) is crossed by no step; it leaves when that component lets go.
    """
    system, at = settling.system, settling.at
    series = system.series(at.s, at.x, at.p, np.maximum(at.z, 0), at.x_error, at.s_error)
    near = np.abs(series.surfaces[:, 0]) <= series.surface_bounds[:, 0]
    return {c for k, c in enumerate(system.surface_of) if near[k]} & set(cluster)
