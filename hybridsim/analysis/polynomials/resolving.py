"""This module converts a run to an `Orbit`, with intervals short enough for accurate polynomials."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.polynomial import legendre

from hybridsim.analysis.polynomials.orbit import NODES, POINTS, TO_COEFFICIENTS, Orbit
from hybridsim.solution import Solution

_TAIL = 4  # last coefficients, which show whether the polynomial is accurate
# of half an interval; samples keep this distance from the ends, where sign(v) may be determined by rounding
_ASIDE_OF_ENDS = 2.0**-26
_RESOLVED = 1e-13  # the misfit relative to the largest value of the whole run
_HOLDS = 1e-6  # if rounding exceeds this fraction of a quantity, no polynomial represents it
_NOISE = 1e-9  # below this fraction, a misfit that halving does not reduce is rounding
_SMALLER = 0.7
_HALVINGS = 24
_MAX_INTERVALS, _MAX_VALUES = 2**17, 2**24  # intervals, and values on all of them: 128 MB
_MAX_PER_STEP = 8.0  # intervals per step, on average, that are always allowed
_VALUES_PER_BATCH = 2**19  # values per batch
_PROBED = 16  # steps at which rounding is measured
# Fractions of a step to probe. A fast quantity is smooth on a short interval, where only rounding remains; but
# on a fraction of 2^-53 the states do not change. The first fraction leaves the states half of their digits,
# the second is for even faster quantities.
_TINY = (2.0**-26, 2.0**-40)
_ASIDE = (
    0.382,
    0.618,
)  # positions in a step; not at points of symmetry, where jumps are likely, and never both at one jump
_ROUNDINGS = 4.0  # multiple of the measured rounding


def _misfits() -> tuple[np.ndarray, np.ndarray]:
    """Return the sample points of an interval, and weights that measure the error of a polynomial.

    Misfits are the last coefficients, and the errors of the polynomial near the ends. Only the latter show a
    feature that begins behind the last Gauss point.
    """
    near = np.array([-1.0, 1.0]) * (1.0 - _ASIDE_OF_ENDS)
    beyond = legendre.legvander(near, POINTS - 1) @ TO_COEFFICIENTS
    tails = TO_COEFFICIENTS[-_TAIL:]
    off = np.concatenate([beyond, -np.eye(2)], axis=1)
    off *= (
        np.abs(tails).sum(axis=1).max() / np.abs(off).sum(axis=1).max()
    )  # rounding contributes equally to each misfit
    return np.append(NODES, near), np.concatenate([np.pad(tails, ((0, 0), (0, 2))), off])


_SAMPLE_POINTS, _MISFITS = _misfits()


class Sample(Protocol):
    """The protocol of a function that evaluates named quantities at local times in given segments."""

    @property
    def names(self) -> tuple[str, ...]: ...
    def __call__(self, index: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return the values (k, Q) at local times s (k,) in the segments with the numbers `index` (k,)."""


class Sampler:
    """Samples states and other quantities inside the segments of a run.

    The other quantities are outputs, discrete states, surfaces of contacts ("velocity of f") and all guards
    by number ("guard 3").

    Parameters
    ----------
    chosen : names of states and quantities of the run; by default all of these.
    """

    def __init__(self, solution: Solution, chosen: Sequence[str] | None = None) -> None:
        self.solution, self.chosen = solution, chosen
        self.system = system = solution._system
        self.segments = solution._segments
        self.quantities = tuple(q for q in system.quantities if " in " not in q)
        self.discrete = tuple(d.name for d in system.model.discrete)
        self.guards = system.guard_count if system.has_tape else 0
        contacts = [system.automata[c].name for c in system.surface_of]
        others = (
            *self.quantities,
            *self.discrete,
            *(f"velocity of {name}" for name in contacts),
            *(f"guard {g}" for g in range(self.guards)),
        )
        self.names = (*system.names, *others) if chosen is None else tuple(chosen)

    def __call__(self, index: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return the values (k, Q) of all quantities at local times in given segments."""
        x = self.segments.states(index, s)
        if self.chosen is not None and set(self.chosen) <= set(self.system.names):
            return x[:, [self.system.names.index(name) for name in self.chosen]]
        out = np.empty((len(s), len(self.names)))
        order = np.argsort(index, kind="stable")
        numbers, first = np.unique(index[order], return_index=True)
        for i, chosen in zip(numbers.tolist(), np.split(order, first[1:]), strict=True):
            out[chosen] = self._within(i, s[chosen], np.ascontiguousarray(x[chosen]))
        return out

    def _within(self, i: int, s: np.ndarray, x: np.ndarray) -> np.ndarray:
        system, segment = self.system, self.segments[i]
        if self.chosen is not None:
            return np.array(self.solution._of_model.values_at(self.chosen, segment, s, x)).T
        named = self.solution._of_model.values_in((*self.quantities, *self.discrete), segment, s, x)
        columns = [x, np.reshape(named, (-1, len(s))).T]
        if not system.has_tape:  # for Python functions: no contacts, and guards without series
            return np.concatenate(columns, axis=1)
        surfaces = system.rows("surfaces", len(system.surface_of), s, x, segment.p, segment.z)
        guards = system.rows("guards", system.guard_count, s, x, segment.p, segment.z)
        guards[:, ~system.active(segment.z)] = 0.0  # guards of other modes
        guards[np.isinf(guards)] = 0.0  # never zero, so that they can be ignored
        return np.concatenate([*columns, surfaces, guards], axis=1)


class _Intervals(NamedTuple):
    """Time intervals, each of which lies inside one segment."""

    segments: np.ndarray
    begins: np.ndarray
    ends: np.ndarray

    def of(self, chosen: np.ndarray | slice) -> _Intervals:
        return _Intervals(*(part[chosen] for part in self))

    def part(self, share: float, length: float) -> _Intervals:
        """Return one part of each interval; start and length of the part are fractions of the interval."""
        whole = self.ends - self.begins
        begins = self.begins + share * whole
        return _Intervals(self.segments, begins, begins + length * whole)

    def halves(self) -> _Intervals:
        middle = 0.5 * (self.begins + self.ends)
        begins = np.stack([self.begins, middle], axis=1).ravel()
        return _Intervals(np.repeat(self.segments, 2), begins, np.stack([middle, self.ends], axis=1).ravel())


class _Finished(NamedTuple):
    """Intervals that need no further division, with values (k, POINTS, Q) and a mask of the varying quantities."""

    intervals: _Intervals
    values: np.ndarray
    is_smooth: np.ndarray


def orbit_of(solution: Solution, chosen: Sequence[str] | None = None) -> Orbit:
    """Return a forward run, or the saved part of it, as an `Orbit` of all or some quantities."""
    index, s, _ = solution._segments.knots()
    same = (index[1:] == index[:-1]) & (s[1:] > s[:-1])
    origins = solution._segments.origins()

    def since_start(segments: np.ndarray, local: np.ndarray) -> np.ndarray:
        at = origins[segments]
        return np.asarray((at[:, 0] - solution.t_start) + (at[:, 1] + local))

    sample = Sampler(solution, chosen)
    return orbit_from(sample, index[:-1][same], s[:-1][same], s[1:][same], since_start)


def orbit_from(
    sample: Sample,
    segments: np.ndarray,
    begins: np.ndarray,
    ends: np.ndarray,
    since_start: Callable[[np.ndarray, np.ndarray], np.ndarray],
) -> Orbit:
    """Return sampled quantities as an `Orbit`.

    Parameters
    ----------
    segments, begins, ends : (K,) intervals in local times of segments, on which the quantities are smooth.
    since_start : returns the time from the start of the run of local times in given segments.
    """
    steps = _Intervals(segments, begins, ends)
    rounding = _ROUNDINGS * _rounding(sample, steps)
    is_too_fast = np.zeros(len(sample.names), dtype=np.bool_)
    while True:  # repeat without the quantities that need too many intervals
        finished, left = _resolved(sample, steps, rounding, ~is_too_fast)
        if not left.any():
            break
        is_too_fast |= left
    intervals = _Intervals(
        *(np.concatenate(parts) for parts in zip(*(f.intervals for f in finished), strict=True))
    )
    order = np.lexsort((intervals.begins, intervals.segments))
    positions = np.split(np.argsort(order), np.cumsum([len(f.values) for f in finished])[:-1])
    values = np.empty((len(order), POINTS, len(sample.names)))
    is_smooth = np.empty((len(order), len(sample.names)), dtype=np.bool_)
    for part, position in zip(finished, positions, strict=True):
        values[position], is_smooth[position] = part.values, part.is_smooth
    values[:, :, is_too_fast] = np.nan
    intervals = intervals.of(order)
    starts = since_start(intervals.segments, intervals.begins)
    too_fast = frozenset(name for name, is_it in zip(sample.names, is_too_fast, strict=True) if is_it)
    lengths = intervals.ends - intervals.begins
    return Orbit(sample.names, starts, lengths, intervals.segments, values, is_smooth, too_fast)


def _resolved(
    sample: Sample, intervals: _Intervals, rounding: np.ndarray, required: np.ndarray
) -> tuple[list[_Finished], np.ndarray]:
    """Divide intervals until required quantities (Q,) are resolved; return the intervals, or a mask of failures."""
    count = len(sample.names)
    most = max(
        min(_MAX_INTERVALS, _MAX_VALUES // (POINTS * count)), int(_MAX_PER_STEP * len(intervals.begins))
    )
    finished: list[_Finished] = []
    done, scale = 0, np.zeros(count)
    before = np.full(
        (len(intervals.begins), count), np.inf
    )  # misfits on the intervals before they were halved
    for halving in range(_HALVINGS):
        values, misfits = _sampled(sample, intervals)
        low, high = values.min(axis=1), values.max(axis=1)
        scale = np.maximum(scale, np.maximum(-low, high).max(axis=0, initial=0.0))
        bound = np.maximum(_RESOLVED * scale, rounding)
        is_rounding = (misfits <= _NOISE * scale) & (misfits >= _SMALLER * before)
        # A quantity with NaN is not smooth there, and halving does not help.
        is_rough = required & (misfits > bound) & ~is_rounding
        # The polynomial of a constant shows only rounding.
        is_smooth = ((misfits <= bound) | is_rounding) & (rounding <= _HOLDS * scale) & (low < high)
        good = ~is_rough.any(axis=1) | (halving == _HALVINGS - 1)
        finished.append(_Finished(intervals.of(good), values[good], is_smooth[good]))
        if good.all():
            break
        done += int(good.sum())
        intervals, before = intervals.of(~good).halves(), np.repeat(misfits[~good], 2, axis=0)
        if done + len(intervals.begins) > most:
            takes = is_rough.sum(axis=0)
            return [], 2 * takes >= takes.max()
    return finished, np.zeros(count, dtype=np.bool_)


def _sampled(sample: Sample, intervals: _Intervals) -> tuple[np.ndarray, np.ndarray]:
    """Return the values (K, POINTS, Q) on intervals, and the largest error of each polynomial."""
    count = len(intervals.begins)
    values, misfits = np.empty((count, POINTS, len(sample.names))), np.empty((count, len(sample.names)))
    block = max(1, _VALUES_PER_BATCH // (len(_SAMPLE_POINTS) * len(sample.names)))
    for first in range(0, count, block):
        chosen = slice(first, first + block)
        segments, begins, ends = intervals.of(chosen)
        at = begins[:, None] + 0.5 * (ends - begins)[:, None] * (1.0 + _SAMPLE_POINTS)
        found = sample(np.repeat(segments, len(_SAMPLE_POINTS)), at.ravel()).reshape(*at.shape, -1)
        found[np.isinf(found)] = np.nan  # no polynomial has a pole
        values[chosen] = found[:, :POINTS]
        misfits[chosen] = np.abs(_MISFITS @ found).max(axis=1)
    return values, misfits


def _rounding(sample: Sample, steps: _Intervals) -> np.ndarray:
    """Return the error (Q,) of fitted polynomials that is due to rounding, measured on very short intervals.

    For a difference of large terms, such as an energy balance, the misfit may consist of rounding on every
    interval.
    """
    count = len(steps.begins)
    probed = steps.of(np.unique(np.linspace(0, count - 1, _PROBED).astype(int)) if count else slice(0))
    probes = [probed.part(share, tiny) for tiny in _TINY for share in _ASIDE]
    values, misfits = _sampled(
        sample, _Intervals(*(np.concatenate(parts) for parts in zip(*probes, strict=True)))
    )
    # otherwise all samples are equal in double precision
    tells = (values.min(axis=1) < values.max(axis=1)) & np.isfinite(misfits)
    least = np.where(tells, misfits, np.inf).reshape(len(probes), -1, len(sample.names)).min(axis=0)
    return np.where(np.isfinite(least), least, 0.0).max(axis=0, initial=0.0)
