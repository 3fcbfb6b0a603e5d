"""This module finds the shortest period of an orbit, and a period without slips that are below the tolerance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hybridsim.analysis.steady.motion import Motion, point_at_end
from hybridsim.analysis.steady.on_guard import slight_slip
from hybridsim.analysis.steady.settling import relative
from hybridsim.analysis.steady.shooting import Orbit, rates_at_end, shoot

# With a multiplier -m of the shorter orbit, the start of a double passage with residual r is off by r / (1 - m**2), and
# one passage changes it by r / (1 - m). This is the largest 1 / (1 - m) for which a shorter orbit is looked for.
_NEAR = 1e3
_SLIGHT = 10.0  # multiple of the tolerance: a contact that slips by less may stick in the limit
_ROUNDED = 1e-9  # the same for a tolerance near rounding, of which a small scale leaves few digits
_LATER = (16, 64, 256)  # periods after which it is looked at again


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
