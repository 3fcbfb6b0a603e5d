"""This module computes derivatives of results of a run: extreme values, amplitudes, integrals and means.

With the derivatives dq of a quantity q at fixed times:

    integral    d(integral of q) = integral of dq + sum over the events of (q- - q+) dt
    extremum    d(max q) = dq at the place of the maximum, where q' = 0 (the envelope theorem), and
                d(max q) = dq + q' dt on one side of an event that moves by dt, if the maximum is there

(J. M. Danskin, SIAM J. Appl. Math. 14 (1966) 641, for the maximum.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybridsim.analysis.compare.comparison_request import checked_names
from hybridsim.analysis.variations.over_time import OverTime
from hybridsim.analysis.variations.readings.extremes import END, START, Extremes, Place
from hybridsim.arguments import text
from hybridsim.errors import UsageError, nearest
from hybridsim.expr.grammar import TIME
from hybridsim.presentation.readable import Readable
from hybridsim.solution.integrals.impulsive import refuse_impulses
from hybridsim.solution.integrals.quadrature import integral

READINGS = ("minimum", "maximum", "amplitude", "integral", "mean")
_AGREE = 1e-7  # of their sizes: derivatives at equal extreme values that differ by less are equal
_ROUNDING = 1e-9  # of the size of the quantity, for a change of everything by its own size
_LEAST = 1e-14  # the same for an integral of rounding errors
_JUMPS = 1e-9  # of its size: a quantity that changes by less at an event does not jump


@dataclass(frozen=True)
class ReadingDerivatives(Readable):
    """A result of a run, such as a maximum, with its derivatives with respect to initial state and parameters.

    Parameters
    ----------
    name : str
        The reading and its quantities, such as "maximum of x".
    value : float
        The reading itself.
    by_start : array
        (n + d,) derivatives with respect to the states and discrete states at the start.
    by_parameter : array
        (P,) derivatives with respect to the chosen parameters.
    """

    name: str
    value: float
    by_start: np.ndarray
    by_parameter: np.ndarray

    def __repr__(self) -> str:
        shapes = f"by_start {self.by_start.shape}, by_parameter {self.by_parameter.shape}"
        return f"Derivatives of the {self.name}, {self.value:.9g}: {shapes}"


def quantities_of(reading: Any, quantities: Sequence[Any]) -> tuple[str, ...]:
    """Check the number and types of the quantities for a reading such as "maximum", and return their names."""
    if text(reading, "reading") not in READINGS:
        raise UsageError(
            f"the reading {reading!r} does not exist", remedy=nearest(reading, READINGS, kind="readings")
        )
    names = checked_names(quantities, "quantities")
    most = len(names) if reading in ("integral", "mean") else 1
    if not 1 <= len(names) <= most:
        raise UsageError(
            f"of() got {len(names)} quantities for the reading {reading!r}",
            remedy=f'name one quantity: of("{reading}", "x")' + ", or several" * (most > 1),
        )
    return names


class Readings:
    """Computes extreme values, means and similar results between two times, with derivatives in M directions.

    Parameters
    ----------
    changes : names of the directions.
    end_shift : derivatives (M,) of `last`, by default zero. They count for an extreme value at this end.
    remedy : replaces the remedies of errors that use a part of the run.
    """

    def __init__(
        self,
        found: OverTime,
        first: float,
        last: float,
        changes: Sequence[str],
        end_shift: np.ndarray | None = None,
        remedy: str = "",
    ) -> None:
        self._found, self._changes, self._remedy = found, changes, remedy
        self._end_shift = np.zeros(found.width) if end_shift is None else end_shift
        self._low, self._high = min(first, last), max(first, last)
        self._sign = 1.0 if last >= first else -1.0
        self._solution = found.solution

    def of(self, reading: str, names: Sequence[str]) -> tuple[float, np.ndarray]:
        """Return the value of a reading, such as a maximum or a mean, and its derivatives (M,)."""
        if reading in ("integral", "mean"):
            refuse_impulses(self._solution, names, f"the {reading}")
            value, slope = self._integral(names)
            share = 1.0 / (self._high - self._low) if reading == "mean" else self._sign
            return share * value, share * slope
        (name,) = names
        if reading == "amplitude":
            (top, by_top), (bottom, by_bottom) = self._extreme(name, 1), self._extreme(name, -1)
            return 0.5 * (top - bottom), 0.5 * (by_top - by_bottom)
        return self._extreme(name, 1 if reading == "maximum" else -1)

    def _extremes(self, name: str) -> Extremes:
        ends = [
            self._solution._of_model.segment_at(np.array([t]), side)
            for t, side in ((self._low, "+"), (self._high, "-"))
        ]
        first, last = ((int(number[0]), float(s[0])) for number, s in ends)
        return Extremes(self._solution, name, first, last)

    # -- extreme values -------------------------------------------------------------------------------------

    def _extreme(self, name: str, sign: int) -> tuple[float, np.ndarray]:
        """Return an extreme value and its derivatives (M,), which are the same at all points with this value."""
        if name == TIME:
            return (self._high if sign > 0 else self._low), np.zeros(self._found.width)
        extremes = self._extremes(name)
        points = extremes.attained(sign)
        slopes = np.array([self._at(extremes, place) for place in points])
        least = _ROUNDING * extremes.size / self._found.own_sizes()
        for place, slope in zip(points[1:], slopes[1:], strict=True):
            apart = np.abs(slope - slopes[0]) > _AGREE * (np.abs(slope) + np.abs(slopes[0])) + least
            if apart.any():
                kind = "maximum" if sign > 0 else "minimum"
                times = " and ".join(f"t = {self._time(one):.9g}" for one in (points[0], place))
                varied = " and ".join(np.array(self._changes)[apart])
                raise UsageError(
                    f"{extremes.name} has the same {kind} {place.value:.9g} at {times}, and a change "
                    f"of {varied} makes the two values different, so there is no derivative",
                    remedy=self._remedy or "use a part of the run with one of these times, t_span=(a, b)",
                )
        return points[0].value, slopes[0] + 0.0 * slopes.sum(axis=0)  # NaN if it is NaN at one of the points

    def _at(self, extremes: Extremes, place: Place) -> np.ndarray:
        """Return the derivatives (M,) of an extreme value at a point; an event may move this point."""
        found, is_after = self._found, place.where == START
        shift = None
        if place.where in (START, END):
            shift = found.shift(place.number + (place.where == END))
            is_limit = (place.number, place.s) in extremes.limits
            if is_limit and shift.any():
                varied = " and ".join(np.array(self._changes)[shift != 0.0])
                raise UsageError(
                    f"the extreme value of {extremes.name} is at t = {self._time(place):.9g}, where an event coincides "
                    f"with an end of the time span; a change of {varied} moves the event, so the extreme value has no "
                    "derivative",
                    remedy=self._remedy or "use a part of the run that ends earlier or later, t_span=(a, b)",
                )
            if (place.number, place.s) == extremes.limits[1]:
                shift = shift + self._end_shift
        return found.moving(extremes.name, place.number, place.s, is_after, shift)

    def _time(self, place: Place) -> float:
        return float(self._solution._segments[place.number].origin.plus(place.s))

    def at_end(self, names: Sequence[str]) -> float:
        """Return the value of a product of quantities at the end of the run, just before any event at this end."""
        lengths = np.diff(self._solution._segments.spans(), axis=1)
        return self._product(names, int(np.flatnonzero(lengths > 0.0)[-1]), -1)

    # -- integrals ------------------------------------------------------------------------------------------

    def _integral(self, names: Sequence[str]) -> tuple[float, np.ndarray]:
        """Return the integral of a product over the part of the run, and its derivatives (M,)."""
        solution, found = self._solution, self._found
        own = solution._trajectory.own_times
        inner = own[(own > self._low) & (own < self._high)]
        edges = np.unique(np.concatenate([[self._low], inner, [self._high]]))
        varying = [i for i, name in enumerate(names) if name != TIME]
        quantities = [names[i] for i in varying]
        for name in set(quantities):
            self._extremes(name).refuse_jumps()

        def factors(times: np.ndarray) -> np.ndarray:
            rows = [times if n == TIME else solution._trajectory.values(n, times, "+") for n in names]
            return np.array(rows)

        def slopes(times: np.ndarray) -> np.ndarray:
            values, total = factors(times), np.zeros((len(times), found.width))
            by = found.along(times, quantities, "+")
            for k, i in enumerate(varying):
                total += np.delete(values, i, axis=0).prod(axis=0)[:, None] * by[:, k]
            return total

        size = np.prod(np.abs(factors(edges)).max(axis=1))
        least = _LEAST * size * (self._high - self._low) / found.own_sizes()
        total = integral(slopes, edges, found.width, least) if quantities else np.zeros(found.width)
        value = solution.integral(*names, t_span=(self._low, self._high))
        return value, total + self._jumps(names, size)

    def _jumps(self, names: Sequence[str], size: float) -> np.ndarray:
        """Return the sum (M,) of (q- - q+) dt over the events of this part of the run; q is a product of quantities."""
        solution, found, total = self._solution, self._found, np.zeros(self._found.width)
        segments = solution._segments
        for number in range(1, len(segments)):
            t, shift = float(segments[number].start), found.shift(number)
            if not (self._low <= t <= self._high) or not shift.any():
                continue
            jump = self._product(names, number - 1, -1) - self._product(names, number, 0)
            if abs(jump) <= _JUMPS * size:
                continue
            if t in (self._low, self._high):
                varied = " and ".join(np.array(self._changes)[shift != 0.0])
                raise UsageError(
                    f"{' * '.join(names)} jumps at t = {t:.9g}, exactly at an end of the time span; a change of "
                    f"{varied} moves the jump, so the integral has no derivative",
                    remedy=self._remedy or "use a part of the run that ends earlier or later, t_span=(a, b)",
                )
            total += jump * shift
        return total

    def _product(self, names: Sequence[str], number: int, end: int) -> float:
        """Return the value of a product of quantities at the start (0) or the end (-1) of a segment."""
        segment = self._solution._segments[number]
        s, x = segment.s[[end]], segment.x[[end]]
        known = [name for name in names if name != TIME]
        values = self._solution._of_model.values_at(known, segment, s, x)
        times = float(segment.origin.plus(float(s[0]))) ** (len(names) - len(known))
        return times * math.prod(float(value[0]) for value in values)
