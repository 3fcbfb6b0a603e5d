"""This module finds a period of an orbit without slips that are below the tolerance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hybridsim.analysis.steady.motion import Motion, point_at_end
from hybridsim.analysis.steady.on_guard import slight_slip
from hybridsim.analysis.steady.settling import relative
from hybridsim.analysis.steady.shooting import Orbit

_SLIGHT = 10.0  # multiple of the tolerance: a contact that slips by less may stick in the limit
_ROUNDED = 1e-9  # the same for a tolerance near rounding, of which a small scale leaves few digits
_LATER = (16, 64, 256)  # periods after which it is looked at again


def after_slight_slips(motion: Motion, orbit: Orbit, scale: np.ndarray, tol: float) -> tuple[Orbit, str]:
    """Return a later period in which no contact slips by less than the tolerance, or the orbit and such a contact.

    A contact that slips less in each period sticks in the limit. Its slips do not become shorter.
    """
    later = orbit
    for count in (0, *_LATER):
        if count:
            end = point_at_end(motion.run(later.start, count * later.period))
            later = replace(later, start=replace(end, at=later.start.at))
        solution = motion.run(later.start, later.period)
        slight = slight_slip(solution, scale, max(_SLIGHT * tol, _ROUNDED))
        if not slight:
            change = point_at_end(solution).values - later.start.values
            return (replace(later, residual=relative(change, scale)) if count else orbit), ""
    return orbit, slight
