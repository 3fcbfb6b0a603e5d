"""This module finds the shortest period of an orbit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hybridsim.analysis.steady.motion import Motion, point_at_end
from hybridsim.analysis.steady.settling import relative
from hybridsim.analysis.steady.shooting import Orbit, rates_at_end, shoot

# With a multiplier -m of the shorter orbit, the start of a double passage with residual r is off by r / (1 - m**2), and
# one passage changes it by r / (1 - m). This is the largest 1 / (1 - m) for which a shorter orbit is looked for.
_NEAR = 1e3


def with_shortest_period(
    motion: Motion, orbit: Orbit, scale: np.ndarray, is_forced: bool, tol: float
) -> Orbit:
    """Return the orbit with its shortest period, of which the period found before may be a multiple.

    Near a doubling of the period, one passage does not return to the start within the tolerance. Then Newton's method
    decides whether an orbit with the shorter period is there. After a doubling it no longer attracts. It may be one of
    a family, as with a contact that sticks for the whole period, because the motion has reached this member.
    """
    for divisor in range(1, orbit.multiple):
        if orbit.multiple % divisor:
            continue
        period = orbit.period * divisor / orbit.multiple
        solution = motion.run(orbit.start, period)
        end = point_at_end(solution)
        if end.z != orbit.start.z:
            continue
        change = relative(end.values - orbit.start.values, scale)
        shorter = replace(orbit, period=period, multiple=divisor, residual=change)
        if change <= max(tol, 10.0 * orbit.residual):
            return shorter
        if change <= _NEAR * tol:
            rates = rates_at_end(solution)
            unit = np.where(scale > 0.0, scale, 1.0)[: len(rates)]
            section = None if is_forced else int(np.argmax(np.abs(rates) / unit))
            found = shoot(motion, shorter, scale, section, tol, in_family=True)
            if found.converged and found.attracts:
                return replace(found, steps=orbit.steps + found.steps)
    return orbit
