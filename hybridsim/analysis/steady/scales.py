"""How small a motion may be before it is rounding, and the sizes of states that come near to zero."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hybridsim.engine.tangents import TangentTape

if TYPE_CHECKING:
    from hybridsim.engine.system import System

_ROUNDINGS = 10.0  # times the relative tolerance of a run: motion below this share of a size is rounding
_LOOSEST = 1e-10  # for which the runs' tolerance stands; a looser one hides motions that are some


def coupled_sizes(system: System, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Sizes (n,) of the states at x, in the units in which each is of the size of those that it swings with.

    A velocity at rest beside a spring at length x is as large as sqrt(k/m) x: an error of rounding in the spring's
    force makes one of that size times rounding. Of two states that act on each other the ratio of their sizes is the
    root of the ratio of what they do to each other's rates; one that decays by itself is no larger than what the other
    makes of it meanwhile.
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


def rounding_of(sizes: np.ndarray, rtol: float) -> np.ndarray:
    """What a run of this tolerance may move states (n,) of these sizes by while nothing moves."""
    return _ROUNDINGS * min(rtol, _LOOSEST) * sizes


def stands_still(system: System, x: np.ndarray, p: np.ndarray, z: np.ndarray, rtol: float) -> bool:
    """Whether errors of the states within the tolerance of a run explain all rates at x."""
    if not system.has_tape or not system.n:
        return True
    f, A = _rates(system, x, p, z)
    return bool((np.abs(f) <= np.abs(A) @ rounding_of(coupled_sizes(system, x, p, z), rtol)).all())


def _rates(system: System, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rates (n,) and their derivatives by the states (n, n)."""
    n = system.n
    seeds = np.eye(n + 1 + len(p), n)
    with np.errstate(over="ignore", invalid="ignore"):  # of a motion that grows without bound
        found = TangentTape(system, z)(np.zeros(1), np.ascontiguousarray(x)[None, :], p, seeds)
    return found.values[0, :n], found.slopes[0, :n]
