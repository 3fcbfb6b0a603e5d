"""This module estimates the sizes of states near zero, and detects motion that consists of rounding only."""

from __future__ import annotations

import numpy as np

from hybridsim.analysis.variations.sizes import ranges
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tangents import TangentTape
from hybridsim.solution import Solution

_ROUNDINGS = 10.0  # multiple of a run's relative tolerance: relative motion below it is rounding
LEAST = (
    1e-3  # smallest scale of a state relative to its size, because a state that hardly moves has fewer digits
)
_LOOSEST = 1e-10  # largest tolerance used here, because a looser one hides slow motions


def coupled_sizes(system: System, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return the sizes (n,) of the states at x; a state near zero gets its size from states coupled to it.

    A velocity at rest next to a spring of length x has the size sqrt(k/m) x, because a rounding error of the
    spring force changes it by that size times rounding. For two states that act on each other, the ratio of
    sizes is the square root of the ratio of their mutual effects on the rates. A state that decays by itself
    is at most as large as the effect of the other one within its decay time.
    """
    sizes = np.abs(x)
    if not system.has_tape or not system.n:
        return sizes
    A = np.abs(_rates(system, x, p, z)[1])
    if not np.isfinite(A).all():
        return sizes
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        swung = np.where(A.T > 0.0, np.sqrt(A / A.T), np.inf)
        driven = np.where(np.diag(A)[:, None] > 0.0, A / np.diag(A)[:, None], np.inf)
        ratio = np.minimum(swung, driven)
    ratio[~np.isfinite(ratio)] = 0.0
    np.fill_diagonal(ratio, 1.0)
    return np.asarray((ratio * sizes[None, :]).max(axis=1))


def shared_sizes(solution: Solution, since: float) -> np.ndarray:
    """Return the size (n,) of each state late in a run, at least the size that the energy of a coupled state causes.

    Two states that act on each other exchange energy, at once or over a third state, as two masses at the ends of a
    spring do over their velocities. With equal energies the ratio of their sizes is the square root of the ratio of
    the mutual effects. The effects are those of the modes late in the run, and of these with all contacts in slip,
    because stick hides effects.
    """
    system, last = solution._system, solution._segments[-1]
    sizes = np.max(np.abs(ranges(solution, since)), axis=0)
    if not system.has_tape or not system.n:
        return np.asarray(sizes)
    modes = solution._segments.modes()[solution._of_model.frame.ends > since]
    slipping = modes.copy()
    for c in system.surface_of:
        slipping[slipping[:, c] == system.automata[c].hold, c] = 0 if system.automata[c].hold else 1
    every = np.unique(np.concatenate([modes, slipping]), axis=0)
    effects = np.max([np.abs(_rates(system, last.x[-1], last.p, z)[1]) for z in every], axis=0)
    ratio = _ratios(effects) if np.isfinite(effects).all() else np.zeros_like(effects)
    is_raised = np.zeros(len(sizes), dtype=np.bool_)
    for _ in range(len(sizes)):
        shares = (ratio * sizes[None, :]).max(axis=1)
        rises = (shares > sizes) & ~is_raised  # once only: a circle of effects may have a gain
        if not rises.any():
            break
        sizes[rises], is_raised[rises] = shares[rises], True
    return np.asarray(sizes)


def _ratios(effects: np.ndarray) -> np.ndarray:
    """Return the ratio (n, n) of the sizes of two states at equal energies, or zero if the two do not interact."""
    has_any = (effects > 0.0) | (effects.T > 0.0)
    mutual = np.where(has_any, effects, effects @ effects)
    is_mutual = (mutual > 0.0) & (mutual.T > 0.0)
    return np.sqrt(np.divide(mutual, mutual.T, out=np.zeros_like(mutual), where=is_mutual))


def rounding_of(sizes: np.ndarray, rtol: float) -> np.ndarray:
    """Return the largest changes (n,) that rounding alone can cause, for given sizes of the states."""
    return _ROUNDINGS * min(rtol, _LOOSEST) * sizes


def stands_still(system: System, x: np.ndarray, p: np.ndarray, z: np.ndarray, rtol: float) -> bool:
    """Return whether all rates at x are zero within the error that the tolerance allows for the states."""
    if not system.has_tape or not system.n:
        return True
    f, A = _rates(system, x, p, z)
    A = np.where(np.isnan(A), np.inf, A)  # a derivative that does not exist bounds nothing
    with np.errstate(invalid="ignore"):
        allowed = np.abs(A) @ rounding_of(coupled_sizes(system, x, p, z), rtol)
    return bool(((np.abs(f) <= allowed) | (f == 0.0)).all())


def _rates(system: System, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rates (n,) and their derivatives with respect to the states (n, n)."""
    n = system.n
    seeds = np.eye(n + 1 + len(p), n)
    with np.errstate(over="ignore", invalid="ignore"):  # a motion may grow without bound
        found = TangentTape(system, z)(np.zeros(1), np.ascontiguousarray(x)[None, :], p, seeds)
    return found.values[0, :n], found.slopes[0, :n]
