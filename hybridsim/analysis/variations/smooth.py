"""This module integrates the derivatives Y' = A(t) Y + B(t) over one segment by Gauss collocation.

It runs along the dense output. Eight Gauss points per piece have order 16 (E. Hairer, S. P. Norsett, G.
Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993, section II.7). The equation is linear, so
that each piece is one linear system. If changes decay within a step, the pieces are computed one after the
other by the formula of Radau IIA instead
(E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, 2nd ed., 1996, section IV.5).
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from hybridsim.errors import UsageError

_STAGES = 8
# last coefficients of the rates on a piece; the error at its end is about the square of the next coefficient
_RESOLVED = 1e-6
TAIL = 2
_NOISE = 1e-5  # below this, a residual that halving does not reduce is rounding
_STIFF_RESOLVED = 1e-11  # the end of a Radau piece is no more accurate than the last coefficients
_STIFF_NOISE = 1e-9
_HALVINGS = 30
CANCELS = 1e-5  # times _RESOLVED: a change of the states, relative to their sizes, of a few hundred roundings

_RADIANS = 0.5  # of a piece at first: fewer rounds of halving than with longer ones
_MAX_PARTS = 2**17  # of a step at first

_FADES = 32  # decays by a factor e per step of the run: explicit methods stay below it, stiff methods do not
_ENTRIES_PER_BATCH = 2**22  # entries of the linear systems that are solved together
_MAX_RADIANS = 2**17  # additional radians that are followed; more take minutes


class Collocation(NamedTuple):
    """A collocation rule: nodes c_i in (0, 1), weights b_j, and integrals a_ij of the Lagrange polynomials.

    coefficients : maps values at the nodes to Legendre coefficients.
    """

    nodes: np.ndarray
    A: np.ndarray
    b: np.ndarray
    coefficients: np.ndarray

    @classmethod
    def at(cls, x: np.ndarray) -> Collocation:
        """Return the collocation rule with nodes x on [-1, 1]."""
        coefficients = np.linalg.inv(legendre.legvander(x, len(x) - 1))
        integrals = [legendre.legint(column, lbnd=-1.0) for column in coefficients.T]
        A = np.array([0.5 * legendre.legval(x, c) for c in integrals]).T
        return cls(
            0.5 * (1.0 + x), A, np.array([0.5 * legendre.legval(1.0, c) for c in integrals]), coefficients
        )


GAUSS = Collocation.at(legendre.leggauss(_STAGES)[0])
# the zeros of P_s - P_(s-1); the last is the end of the piece
RADAU = Collocation.at(np.sort(legendre.legroots([*[0.0] * (_STAGES - 1), -1.0, 1.0]).real))

NumberedSlopes = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""The type of derivatives (m, n, n + q) in segments with given numbers (m,) at local times (m,)."""

Slopes = Callable[[np.ndarray], np.ndarray]
"""The type of derivatives (m, n, n + q) of the rates at local times (m,) with respect to n states and q constants."""


class Intervals(NamedTuple):
    """Intervals of segments in order of time: number of the segment, local times of both ends, and derivatives.

    matrices (K, n, n + q) : d(states at the end of a piece)/d(states at its begin, constants).
    """

    number: np.ndarray
    begins: np.ndarray
    ends: np.ndarray
    matrices: np.ndarray


class Steps(NamedTuple):
    """Steps of a run: number of the segment (K,), and local times (K,) of both ends."""

    number: np.ndarray
    begins: np.ndarray
    ends: np.ndarray


Over = Callable[[Steps], tuple[np.ndarray, np.ndarray]]
"""The type of derivatives (K, n, n + q) over pieces, and a measure (K,) of how well each is resolved."""


def divided(slopes: NumberedSlopes, steps: Steps, fastest: float) -> tuple[Steps, set[int]]:
    """Return steps that resolve the eigenvalues and the fastest forcing, and the numbers of the stiff segments.

    In a stiff segment changes decay within a step. Its steps are left out. Fast rotation is refused.
    """
    number, begins, ends = steps
    decay, size = _speeds(slopes, number, begins, ends)
    counts = np.bincount(number)
    fades = np.bincount(number, decay * (ends - begins))
    turns = np.bincount(number, size * (ends - begins))
    stiff = fades > _FADES * counts + 2**12
    for one in np.flatnonzero((turns > _FADES * counts + _MAX_RADIANS) & ~stiff):
        here = number == one
        raise UsageError(
            f"the derivatives oscillate through about {turns[one]:.1g} radians between t = {begins[here].min():.9g} "
            f"(the last event) and {ends[here].max():.9g}, so their computation would take minutes or longer",
            remedy="simulate a shorter time, or choose parameters for which the motion is slower",
        )
    regular = ~stiff[number]
    chosen = Steps(number[regular], begins[regular], ends[regular])
    return in_parts(chosen, size[regular], fastest), set(np.flatnonzero(stiff).tolist())


def are_slow(steps: Steps, speeds: np.ndarray) -> bool:
    """Return whether eigenvalues below a bound (K,) show that no segment is stiff or rotates fast."""
    turns = np.bincount(steps.number, speeds * (steps.ends - steps.begins))
    return bool((turns <= _FADES * np.bincount(steps.number) + 2**12).all())


def in_parts(steps: Steps, speeds: np.ndarray, fastest: float) -> Steps:
    """Divide steps until they resolve the fastest forcing, and eigenvalues as large as `speeds` (K,)."""
    number, begins, ends = steps
    radians = (ends - begins) * np.maximum(speeds, fastest)
    if (radians <= _RADIANS).all():
        return steps
    count = np.ceil(radians / _RADIANS).clip(1, _MAX_PARTS).astype(np.int64)
    part = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    number, first, length = (np.repeat(each, count) for each in (number, begins, (ends - begins) / count))
    is_last = part + 1 == np.repeat(count, count)
    last = np.where(is_last, np.repeat(ends, count), first + (part + 1) * length)
    return Steps(number, first + part * length, last)


def transitions(over: Over, steps: Steps) -> Intervals:
    """Return the derivatives over pieces of segments, which are halved until they are resolved."""
    number, begins, ends = steps
    found_parts: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = []
    before = np.full(len(begins), np.inf)
    for halving in range(_HALVINGS):
        found, tails = over(Steps(number, begins, ends))
        is_rounding = (tails <= _NOISE) & (tails >= 0.7 * before)
        good = (tails <= _RESOLVED) | is_rounding | (halving == _HALVINGS - 1)
        if not halving and good.all():
            return Intervals(number, begins, ends, found)
        found_parts.append((number[good], begins[good], ends[good], found[good]))
        if good.all():
            break
        number, begins, ends, before = number[~good], begins[~good], ends[~good], tails[~good]
        middle = 0.5 * (begins + ends)
        begins, ends = np.stack([begins, middle], axis=1).ravel(), np.stack([middle, ends], axis=1).ravel()
        number, before = np.repeat(number, 2), np.repeat(before, 2)
    numbers, starts, until, matrices = (np.concatenate(each) for each in zip(*found_parts, strict=True))
    order = np.lexsort((starts, numbers))
    return Intervals(numbers[order], starts[order], until[order], matrices[order])


class _Stops:
    """Collects the derivatives at given times in ascending order."""

    def __init__(self, stops: np.ndarray, begin: float, total: np.ndarray) -> None:
        self._stops, self.found = stops.tolist(), list[np.ndarray]()
        self.add(begin, total)

    def add(self, s: float, total: np.ndarray) -> None:
        while len(self.found) < len(self._stops) and self._stops[len(self.found)] <= s:
            self.found.append(total)


def _speeds(
    slopes: NumberedSlopes, number: np.ndarray, begins: np.ndarray, ends: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the fastest decay rate (K,), and the largest absolute eigenvalue (K,), in the middle of each part."""
    found = slopes(number, 0.5 * (begins + ends))
    A = found[:, :, : found.shape[1]]
    finite = np.asarray(np.isfinite(A).all(axis=(1, 2)))
    A = np.where(finite[:, None, None], A, 0.0)
    eigenvalues = np.linalg.eigvals(A)
    decay = np.maximum(-eigenvalues.real, 0.0).max(axis=1, initial=0.0)
    return decay, np.abs(eigenvalues).max(axis=1, initial=0.0)


def stiff_transitions(
    slopes: Slopes, knots: np.ndarray, scale: np.ndarray, constants: np.ndarray, stops: np.ndarray
) -> np.ndarray:
    """Return the derivatives over a stiff segment by Radau's formula, which allows longer steps.

    The formula damps unresolved changes, so that only those that have not decayed need to be resolved.
    """
    n = len(scale)
    Y = np.eye(n, n + len(constants))
    reached = _Stops(stops, knots[0], Y)
    # in units of the states; the first n columns have the size of the largest, the others each their own
    units = np.concatenate([scale, np.ones(len(constants))]) / scale[:, None]
    least = np.concatenate([np.ones(n), CANCELS / constants])
    waiting = [(begin, end, np.inf) for begin, end in pairwise(knots)][::-1]
    most = 16 * len(waiting) + 2**14
    for _ in range(most):
        if not waiting:
            return np.array(reached.found)
        begin, end, before = waiting.pop()
        length, middle = end - begin, 0.5 * (begin + end)
        rates = _rates(RADAU, slopes, np.array([begin]), np.array([length]), Y)[0]
        tails = (
            length * np.abs(np.einsum("ci,iab->cab", RADAU.coefficients[-TAIL:], rates)).max(axis=0) * units
        )
        sizes = (np.abs(Y) * units).max(axis=0)
        sizes[:n] = sizes[:n].max()
        tail = float((tails / np.maximum(sizes, least)).max())
        is_rounding = 0.7 * before <= tail <= _STIFF_NOISE
        if tail <= _STIFF_RESOLVED or is_rounding or not begin < middle < end:
            Y = Y + length * np.einsum("i,iab->ab", RADAU.b, rates)
            reached.add(end, Y)
        else:
            waiting += [(middle, end, tail), (begin, middle, tail)]
    raise UsageError(
        f"the derivatives between t = {knots[0]:.9g} (the last event) and {knots[-1]:.9g} vary too fast for {most} "
        "intervals",
        remedy="simulate a shorter time, or choose parameters for which the motion is slower",
    )


def over_intervals(
    slopes: NumberedSlopes, steps: Steps, scale: np.ndarray, constants: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives over each piece, and a measure of how well each piece is resolved."""
    most = max(1, _ENTRIES_PER_BATCH // (_STAGES * len(scale)) ** 2)
    batches = [Steps(*(each[k : k + most] for each in steps)) for k in range(0, len(steps.number), most)]
    done = [_over_batch(slopes, batch, scale, constants) for batch in batches]
    found, tails = (np.concatenate(each) for each in zip(*done, strict=True))
    return found, tails


def _over_batch(
    slopes: NumberedSlopes, steps: Steps, scale: np.ndarray, constants: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    number, begins, ends = steps
    lengths = ends - begins
    at = np.repeat(number, _STAGES)
    rates = _rates(GAUSS, lambda s: slopes(at, s), begins, lengths)
    moved = lengths[:, None, None] * np.einsum("i,kiab->kab", GAUSS.b, rates)
    n = moved.shape[1]
    moved[:, :, :n] += np.eye(n)
    tails = np.abs(np.einsum("ci,kiab->kcab", GAUSS.coefficients[-TAIL:], rates)).max(axis=1)
    tails *= lengths[:, None, None] / scale[:, None]
    sizes = np.abs(moved) / scale[:, None]
    sizes[:, :, :n] *= scale
    tails[:, :, :n] *= scale
    # the states by the states as one matrix without units; each of the constants by itself
    resolved = tails[:, :, :n].max(axis=(1, 2)) / sizes[:, :, :n].max(axis=(1, 2))
    others, largest = tails[:, :, n:].max(axis=1), sizes[:, :, n:].max(axis=1)
    # relative to the effect of a change of a constant by its own size; below CANCELS only rounding is left
    relative = others / np.maximum(largest, CANCELS / constants)
    return moved, np.maximum(resolved, relative.max(axis=1, initial=0.0))


def _rates(
    method: Collocation, slopes: Slopes, begins: np.ndarray, lengths: np.ndarray, Y: np.ndarray | None = None
) -> np.ndarray:
    """Return the derivatives (K, stages, n, n + q) of the rates with respect to the start, at the collocation nodes."""
    D = slopes((begins[:, None] + lengths[:, None] * method.nodes).ravel())
    stages, count, n, width = len(method.nodes), len(begins), D.shape[1], D.shape[2]
    D = D.reshape(count, stages, n, width)
    A = D[..., :n]
    if Y is not None:
        D = A @ Y + np.concatenate([np.zeros_like(A), D[..., n:]], axis=-1)
    # K_i - h sum_j a_ij A_i K_j = A_i Y0 + B_i for the columns of Y
    system = -lengths[:, None, None, None, None] * np.einsum("ij,kiab->kiajb", method.A, A)
    system = system.reshape(count, stages * n, stages * n) + np.eye(stages * n)
    solved: np.ndarray = np.linalg.solve(system, D.reshape(count, stages * n, width))
    return solved.reshape(count, stages, n, width)
