"""This module finds a periodic orbit by Newton's method on the period map, as a zero of x(T) - x(0)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hybridsim.analysis.steady.motion import Motion, Point, point_at_end
from hybridsim.analysis.steady.on_guard import lies_on_a_guard
from hybridsim.analysis.steady.settling import relative
from hybridsim.analysis.variations.off_zero import rates_of
from hybridsim.analysis.variations.sensitivities import derivatives
from hybridsim.arguments import SMALLEST_RTOL
from hybridsim.errors import HybridsimError
from hybridsim.solution import Solution

_STEPS = 12
_LESS = 0.5  # a step that leaves a larger part of the residual is rejected
_ROUNDING = 1e-14  # relative to the states' scale; no step makes the residual smaller
# An orbit with a larger multiplier is not reached by waiting: it repels, or is one of a family.
_ATTRACTS = 1.0 - 1e-6
_DOUBLE = 1e-3  # distance of two multipliers from 1; closer ones are separated by the direction of the motion


@dataclass(frozen=True)
class Orbit:
    """A periodic orbit, or an approximation of one.

    Parameters
    ----------
    start : its point at time 0.
    period : time after which it repeats; multiple: the same in periods of the forcing or passages of the section.
    residual : largest change of a state over the period, relative to its scale.
    steps : number of steps of Newton's method.
    attracts : whether all multipliers are inside the unit circle, and the orbit is inside its modes.
    """

    start: Point
    period: float
    multiple: int
    residual: float
    steps: int = 0
    converged: bool = True
    attracts: bool = True


def shoot(
    motion: Motion,
    start: Orbit,
    scale: np.ndarray,
    section: int | None,
    tol: float,
    in_family: bool = False,
) -> Orbit:
    """Find a periodic orbit near a given start by Newton's method.

    Parameters
    ----------
    scale : (n + d,) size of each state and discrete state.
    section : None if the period is known; else the state that keeps its value while the period is found.
    in_family : whether an orbit with a multiplier of 1, which has neighbours of the same period, counts as attracting.
    """
    best = replace(start, residual=np.inf, converged=False)
    orbit = start
    for count in range(_STEPS + 1):
        try:
            solution = motion.run(orbit.start, orbit.period)
            end = point_at_end(solution)
            if end.z != orbit.start.z:
                break
            change = end.values - orbit.start.values
            residual = relative(change, scale)
            if not residual <= (_LESS * best.residual if count else np.inf) and residual > _ROUNDING:
                break
            motion.carry(solution)
            matrix = derivatives(solution, ()).by_start
        except HybridsimError:
            break
        rates = None
        if section is not None:
            rates = rates_at_end(solution)
        move, longer = newton_step(matrix, change, scale, section, rates)
        best = replace(orbit, residual=residual, steps=count, attracts=_attracts(matrix, rates, in_family))
        # The remaining error is the step itself.
        if residual <= tol and relative(move, scale) <= tol and abs(longer) <= tol * orbit.period:
            attracts = best.attracts and not lies_on_a_guard(solution, scale)
            return replace(best, converged=True, attracts=attracts)
        orbit = replace(orbit, start=orbit.start.moved(move), period=orbit.period + longer)
        if not orbit.period > 0.0:
            break
    return replace(best, converged=False)


def followed_closely(motion: Motion, start: Orbit, scale: np.ndarray, is_free: bool) -> Orbit:
    """Return an orbit that is recomputed at the tightest tolerance; an unknown period is corrected too.

    Orbits in a continuum, as in a system that conserves energy, change only by the numerical loss of a run.
    """
    try:
        solution = motion.run(start.start, start.period, rtol=SMALLEST_RTOL)
    except HybridsimError:
        return replace(start, residual=np.inf)
    end = point_at_end(solution)
    if end.z != start.start.z:
        return replace(start, residual=np.inf)
    rates = rates_at_end(solution) if is_free else np.zeros(0)
    change, late = across(end.values - start.start.values, rates, scale)
    return replace(start, period=start.period - late, residual=relative(change, scale))


def across(change: np.ndarray, rates: np.ndarray, scale: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the part of a change (n + d,) across the direction of the motion, and the time that the rest of it takes.

    rates (n,): dx/dt, or empty if the period is known. The whole change counts then.
    """
    if not rates.any():
        return change, 0.0
    unit = np.where(scale > 0.0, scale, 1.0)
    way = np.append(rates, np.zeros(len(change) - len(rates))) / unit
    late = float((change / unit) @ way / (way @ way))
    return change - late * way * unit, late


def newton_step(
    matrix: np.ndarray, change: np.ndarray, scale: np.ndarray, section: int | None, rates: np.ndarray | None
) -> tuple[np.ndarray, float]:
    """Return the Newton correction of the start and the period."""
    count = len(change)
    unit = np.where(scale > 0.0, scale, 1.0)
    A = np.eye(count) - matrix * unit[None, :] / unit[:, None]
    b = change / unit
    if section is None or rates is None:
        return unit * np.linalg.lstsq(A, b, rcond=None)[0], 0.0
    grown = np.zeros((count + 1, count + 1))
    grown[:count, :count] = A
    grown[: len(rates), count] = -rates / unit[: len(rates)]
    grown[count, section] = 1.0
    found = np.linalg.lstsq(grown, np.append(b, 0.0), rcond=None)[0]
    return unit * found[:count], float(found[count])


def _attracts(matrix: np.ndarray, rates: np.ndarray | None, in_family: bool) -> bool:
    found = multipliers(matrix, rates)
    is_neutral = in_family & (np.abs(found - 1.0) <= 1.0 - _ATTRACTS)
    return bool((is_neutral | (np.abs(found) <= _ATTRACTS)).all())


def rates_at_end(solution: Solution) -> np.ndarray:
    """Return dx/dt (n,) at the end of a run."""
    last = solution._segments[-1]
    return rates_of(solution._system, float(last.s[-1]), last.x[-1], last.p, last.z)


def multipliers(matrix: np.ndarray, rates: np.ndarray | None) -> np.ndarray:
    """Return the Floquet multipliers, largest first. For an unforced orbit, the trivial multiplier 1 is left out.

    rates (n,): dx/dt at the end of the orbit, for a motion without forcing. If another multiplier is about 1
    as well, as on closed orbits of a conservative system, both are accurate only to the square root of
    rounding. The rates are the eigenvector of the trivial one, and the others are multipliers of the matrix
    across this direction.
    """
    found = np.linalg.eigvals(matrix)
    if rates is not None:
        distance = np.abs(found - 1.0)
        near = np.argsort(distance)
        found = np.delete(found, near[0])
        if len(near) > 1 and distance[near[1]] < _DOUBLE and rates.any():
            found = np.linalg.eigvals(_beside(matrix, rates))
    return found[np.argsort(-np.abs(found), kind="stable")]


def _beside(matrix: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Return the restriction of a matrix to the subspace orthogonal to the rates."""
    direction = np.zeros((len(matrix), 1))
    direction[: len(rates), 0] = rates
    across = np.linalg.qr(direction, mode="complete")[0][:, 1:]
    return across.T @ matrix @ across
