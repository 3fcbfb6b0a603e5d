"""This module defines a branch of periodic orbits: its points, and the bifurcations along it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from itertools import pairwise
from typing import Any

import numpy as np

from hybridsim.analysis.steady.motion import Motion
from hybridsim.analysis.steady.result import SteadyState
from hybridsim.analysis.steady.shooting import Orbit
from hybridsim.presentation.readable import Readable

_ON_THE_CIRCLE = 1e-9
_CLEAR = 1e-7  # distance from +1; a closer multiplier is +1 up to the rounding of derivatives


@dataclass(frozen=True)
class BranchPoint:
    """One orbit of a branch.

    Parameters
    ----------
    parameter : its value.
    orbit, motion : the orbit, and the model at that value.
    multipliers : Floquet multipliers, largest first; without forcing the one along the motion is left out.
    word : the sequence of its modes.
    is_free : whether the period is unknown, as it is without forcing.
    """

    parameter: float
    orbit: Orbit
    motion: Motion
    multipliers: np.ndarray
    word: tuple[str, ...]
    is_free: bool

    @property
    def stable(self) -> bool:
        """Whether all multipliers are inside the unit circle."""
        return bool((np.abs(self.multipliers) <= 1.0 + _ON_THE_CIRCLE).all())

    @cached_property
    def steady(self) -> SteadyState:
        """This orbit as a steady state, with amplitudes, energies and other measures."""
        message = f"orbit of a branch; residual {self.orbit.residual:.1e}"
        return SteadyState(self.motion, "periodic", self.orbit, self.is_free, 0, 0, message)


@dataclass(frozen=True)
class Special:
    """A bifurcation, or a change of the mode sequence, between two points of a branch.

    kind : "fold" (the branch turns back in the parameter), "branch point" (a multiplier passes +1 without a fold:
        another branch crosses, as at a loss of symmetry), "period doubling" (a multiplier passes -1), "torus" (a pair
        passes the unit circle), "sequence" (the sequence of modes changes: a graze, or a new stop).
    parameter : its value there, interpolated between two points of the branch: accurate to three or four digits at
        a period doubling, more at a fold.
    index : the number of the point before it.
    """

    kind: str
    parameter: float
    index: int


@dataclass(frozen=True)
class Branch(Readable):
    """A curve of periodic orbits over a parameter.

    Parameters
    ----------
    name : str
        The name of the parameter.
    points : tuple of BranchPoint
        In order along the branch; the parameter need not be monotone.
    special : tuple of Special
        Folds, branch points, period doublings, tori, changes of the sequence of modes.
    message : str
        The reasons why it ended, at both ends.

    Examples
    --------
    >>> import hybridsim as hs
    >>> branch = hs.continuation("dfcs", "F0", (29.0, 31.0))
    >>> len(branch.parameter) == len(branch.points), len(branch.special)
    (True, 0)
    """

    name: str
    points: tuple[BranchPoint, ...]
    special: tuple[Special, ...]
    message: str

    @property
    def parameter(self) -> np.ndarray:
        """Values of the parameter (K,)."""
        return np.array([p.parameter for p in self.points])

    @property
    def stable(self) -> np.ndarray:
        """Whether each orbit is stable (K,)."""
        return np.array([p.stable for p in self.points])

    @property
    def period(self) -> np.ndarray:
        """Periods (K,)."""
        return np.array([p.orbit.period for p in self.points])

    def amplitude(self, name: str) -> np.ndarray:
        """Return (max - min)/2 of a quantity on each orbit (K,)."""
        return np.array([p.steady.amplitude[name] for p in self.points])

    def plot(self, name: str | None = None) -> Any:
        """Draw the amplitude of a quantity, by default of the first state, over the parameter.

        Unstable orbits are dashed, and bifurcations are marked; see `hybridsim.plot.branch`. It returns the axes;
        ``hybridsim.plot.save`` writes them to a file. An unknown name raises `UsageError`.
        """
        # The plot package is a layer above this one, so it is imported only on demand.
        return import_module("hybridsim.plot").branch(self, name)

    def __repr__(self) -> str:
        values = self.parameter
        lines = [
            f"Branch of {len(self.points)} orbits over {self.name} from {values.min():.6g} to {values.max():.6g}, "
            f"{int((~self.stable).sum())} of them unstable: {self.message}"
        ]
        return "\n".join([*lines, *(f"  {s.kind} at {self.name} = {s.parameter:.9g}" for s in self.special)])


def specials(points: tuple[BranchPoint, ...]) -> tuple[Special, ...]:
    """Return the bifurcations and changes of the mode sequence between consecutive points."""
    found: list[Special] = []
    for i, (a, b) in enumerate(pairwise(points)):
        if a.word != b.word:
            found.append(Special("sequence", 0.5 * (a.parameter + b.parameter), i))
        found += _stability_changes(a, b, i)
        if i > 0 and (a.parameter - points[i - 1].parameter) * (b.parameter - a.parameter) < 0.0:
            found.append(Special("fold", _turn(points[i - 1], a, b), i))
    return tuple(sorted([*found, *_branchings(points, found)], key=lambda s: s.index))


def _branchings(points: tuple[BranchPoint, ...], found: list[Special]) -> list[Special]:
    """Return the points at which a multiplier passes +1 without a fold, where another branch begins.

    They are sign changes of the product of 1 - m over all multipliers; each fold explains the sign change
    next to it.
    """
    folds = [s.index for s in found if s.kind == "fold"]
    branchings = []
    for i, (a, b) in enumerate(pairwise(points)):
        if a.word != b.word or len(a.multipliers) != len(b.multipliers):
            continue
        below, above = (float(np.prod(1.0 - p.multipliers).real) for p in (a, b))
        clear = all(np.abs(1.0 - p.multipliers).min(initial=np.inf) > _CLEAR for p in (a, b))
        if not (clear and below * above < 0.0):
            continue
        nearest = min(folds, key=lambda k: abs(k - i), default=None)
        if nearest is not None and -1 <= nearest - i <= 2:
            folds.remove(nearest)
            continue
        at = a.parameter + below / (below - above) * (b.parameter - a.parameter)
        branchings.append(Special("branch point", at, i))
    return branchings


def _stability_changes(a: BranchPoint, b: BranchPoint, i: int) -> list[Special]:
    """Return the points at which a multiplier passes -1, or a complex pair passes the unit circle."""
    if a.word != b.word or len(a.multipliers) != len(b.multipliers):
        return []
    found = []
    least = [min(m.real for m in p.multipliers if m.imag == 0.0) if _has_real(p) else 0.0 for p in (a, b)]
    if (least[0] + 1.0) * (least[1] + 1.0) < 0.0:
        share = (-1.0 - least[0]) / (least[1] - least[0])
        found.append(Special("period doubling", a.parameter + share * (b.parameter - a.parameter), i))
    largest = [max((abs(m) for m in p.multipliers if m.imag != 0.0), default=0.0) for p in (a, b)]
    if min(largest) > 0.0 and (largest[0] - 1.0) * (largest[1] - 1.0) < 0.0:
        share = (1.0 - largest[0]) / (largest[1] - largest[0])
        found.append(Special("torus", a.parameter + share * (b.parameter - a.parameter), i))
    return found


def _has_real(point: BranchPoint) -> bool:
    return any(m.imag == 0.0 for m in point.multipliers)


def _turn(a: BranchPoint, b: BranchPoint, c: BranchPoint) -> float:
    """Return the extreme value of the parameter near point b, from the parabola through three points of a branch."""
    scale = np.maximum(np.abs(b.orbit.start.values), np.finfo(float).tiny)
    d1 = float(np.linalg.norm((b.orbit.start.values - a.orbit.start.values) / scale))
    d2 = float(np.linalg.norm((c.orbit.start.values - b.orbit.start.values) / scale))
    if not d1 > 0.0 or not d2 > 0.0:
        return b.parameter
    coefficients = np.polyfit([-d1, 0.0, d2], [a.parameter, b.parameter, c.parameter], 2)
    at = -coefficients[1] / (2.0 * coefficients[0])
    return float(np.polyval(coefficients, at)) if -d1 <= at <= d2 else b.parameter
