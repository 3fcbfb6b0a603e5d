"""This module follows motions with incommensurate forcing periods until a disturbance of the start has decayed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybridsim.analysis.steady.motion import Motion, point_at_end
from hybridsim.analysis.steady.settling import RESTS
from hybridsim.analysis.steady.shooting import Orbit
from hybridsim.analysis.variations.sensitivities import derivatives
from hybridsim.analysis.variations.sizes import ranges, sizes
from hybridsim.errors import UsageError

_DIES_OUT = 1e-6  # a change of the start that has shrunk to this factor counts as zero
_MAX_SLOW_PERIODS = 512  # periods of the slowest forcing
_LONGER = 4
_NO_PERIOD = "the periods of forcing and clocks have no common multiple"


class Followed(NamedTuple):
    """The result of `follow`: an equilibrium if one was found, and whether a disturbance of the start decays."""

    rests: Orbit | None
    dies_out: bool
    periods: int
    message: str


def follow(motion: Motion, longest: float, settle: int, max_periods: int) -> Followed:
    """Follow a motion over more and more periods of its slowest forcing, until a disturbance of the start decays.

    If every small change of the start decays, the motion follows the forcing alone, with its frequencies and
    their sums: it is quasi-periodic. Otherwise it has further frequencies, or is chaotic.
    """
    count = settle
    while True:
        solution = motion.run(None, count * longest, is_carried=True)
        low, high = ranges(solution, 0.5 * solution.t_end)
        largest = sizes(solution)
        if (high - low <= RESTS * largest).all() and not solution._system.layout.discrete:
            rest = Orbit(point_at_end(solution), longest, 1, 0.0)
            message = (
                f"equilibrium: nothing moves in the second half of {count} periods of the slowest forcing"
            )
            return Followed(rest, True, count, f"{message}; {_NO_PERIOD}")
        motion.carry(solution)
        try:
            matrix = derivatives(solution, ()).by_start
        except UsageError as reason:
            return Followed(None, False, count, f"not settled: {_NO_PERIOD}; {reason.message}")
        unit = np.where(largest > 0.0, largest, 1.0)
        unit = np.concatenate([unit, np.ones(len(matrix) - len(unit))])
        left = float(np.abs(matrix * unit[None, :] / unit[:, None]).max(initial=0.0))
        growth = (
            f"an initial change is {left:.1e} times as large after {count} periods of the slowest forcing"
        )
        if left <= _DIES_OUT:
            return Followed(None, True, count, f"quasi-periodic: {_NO_PERIOD}, and {growth}")
        if count * _LONGER > min(max_periods, _MAX_SLOW_PERIODS):
            return Followed(None, False, count, f"not settled: {_NO_PERIOD}, and {growth}")
        count *= _LONGER
