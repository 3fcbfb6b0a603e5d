"""This module follows a repeating motion until no contact slips by less than the tolerance."""

from __future__ import annotations

import numpy as np

from hybridsim.analysis.extrapolation.period_map import PeriodMap
from hybridsim.analysis.steady.settling import relative
from hybridsim.errors import SimulationError

_SLIGHT = 10.0  # multiple of the tolerance: a contact that slips by less may stick in the limit
_ROUNDED = 1e-9  # the same for a tolerance near rounding, of which a small scale leaves few digits
_LATER = (16, 64, 256)  # repetitions after which the motion is looked at again


def after_slight_slips(
    period_map: PeriodMap, periods: int, residual: float, scale: np.ndarray, tol: float
) -> tuple[float, str]:
    """Follow a motion that repeats until it has no slight slip; return its residual, and a contact that keeps one.

    A contact that slips less in each period sticks in the limit. Its slips do not become shorter. If slight slips
    remain, the map returns to its states at the call; otherwise the name is empty.

    Parameters
    ----------
    periods : number of periods of the map after which the motion repeats.
    residual : largest change of a state over them, in units of the scale.
    scale : (n,) size of each state.
    """
    first, present, slight = period_map.snapshot(), residual, ""
    most = max(_SLIGHT * tol, _ROUNDED)
    try:
        for count in (0, *_LATER):
            for _ in range(count):
                before = period_map.x
                for _ in range(periods):
                    period_map.advance()
                present = relative(period_map.x - before, scale)
            start = period_map.snapshot()
            slight = period_map.slight_slip(periods, scale, most)
            period_map.restore(start)
            if not slight:
                return present, ""
    except SimulationError:  # the slips become too short to be told apart
        pass
    period_map.restore(first)
    return residual, slight


def message_of(slight: str) -> str:
    """Return the end of a message about a motion in which a contact keeps a slight slip, or ""."""
    return (
        f"; contact {slight} slips by less than the tolerance, and may stick in the limit" if slight else ""
    )
