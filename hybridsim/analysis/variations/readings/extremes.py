"""This module finds the points at which a quantity of a run has its least or greatest value."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from hybridsim.analysis.polynomials.orbit import NODES, POINTS, TO_COEFFICIENTS
from hybridsim.analysis.polynomials.resolving import orbit_of
from hybridsim.errors import UsageError
from hybridsim.solution import Solution

_TIE = 1e-12  # of the largest value, and no less than the tolerance of the run: values that differ by less are equal
_SLOPE = legendre.legder(np.eye(POINTS))  # coefficients to those of the slope
_JUMPS = 1e-6  # of the largest value: a smaller change within a piece that is halved 24 times is a kink
_REMEDY = "declare an event there: a guard, a switching surface, or a monitor with a reset"
INSIDE, START, END, HELD = 0, 1, 2, 3  # a place inside a segment, at its start or end, or on a constant part
_SAME = 1e-12  # of the largest value: a place with an exact time is chosen if it is lower by less
_BETWEEN = np.linspace(0.0, 1.0, 9)  # points of a piece at which it is compared with the extreme values


class Place(NamedTuple):
    """A candidate for an extreme value: segment, local time, kind of point, value and interval."""

    number: int
    s: float
    where: int
    value: float
    piece: int


class Extremes:
    """Finds the extreme values of one quantity over a part of a run.

    Parameters
    ----------
    first, last : segment number and local time of the first and of the last point of the part.
    """

    def __init__(
        self, solution: Solution, name: str, first: tuple[int, float], last: tuple[int, float]
    ) -> None:
        orbit = orbit_of(solution, (name,))
        self.name, self._segments = name, solution._segments
        origins = solution._segments.origins()[orbit.segments]
        begins = orbit.starts - (origins[:, 0] - solution.t_start) - origins[:, 1]
        inside = [
            k
            for k, (number, begin, length) in enumerate(
                zip(orbit.segments.tolist(), begins.tolist(), orbit.lengths.tolist(), strict=True)
            )
            if (number, begin + length) > first and (number, begin) < last
        ]
        self._orbit, self._begins, self._inside = orbit, begins, inside
        self._series = orbit.of(name) @ TO_COEFFICIENTS.T
        if not np.isfinite(orbit.of(name)[inside]).all():
            raise UsageError(
                f"{name} is not finite at some times, so it cannot be measured",
                remedy=f"use a part of the run, t_span=(a, b), in which {name} is finite",
            )
        self._first, self._last = self.limits = first, last
        self.size = float(np.abs(orbit.of(name)[inside]).max(initial=0.0))
        self._tie = max(_TIE, solution._run.task.tolerances.rtol) * self.size

    def attained(self, sign: int) -> list[Place]:
        """Return the points of the greatest value (sign 1) or the least value (sign -1), with the best point first.

        Values that differ by less than the accuracy of the run are equal. Of points that are not separated by other
        values, one is returned.
        """
        found = [*self._turns(sign), *self._ends(sign), *self._plateaus()]
        found.sort(key=lambda place: -sign * place.value)
        rough = sign * self._rough()
        if not found or (rough.size and rough.max() >= sign * found[0].value - self._tie):
            raise UsageError(
                f"{self.name} has a kink or a jump at its extreme value, between two events of the run",
                remedy=_REMEDY,
            )
        equal = [place for place in found if abs(place.value - found[0].value) <= self._tie]
        chosen = [self._representative(group, sign) for group in self._groups(equal, sign)]
        return sorted(chosen, key=lambda place: -sign * place.value)

    def _groups(self, points: list[Place], sign: int) -> list[list[Place]]:
        """Group points if all values between the points are equal to the values at the points."""
        least = min(sign * place.value for place in points) - self._tie
        ordered = sorted(points, key=lambda place: (place.number, place.s))
        groups = [ordered[:1]]
        for place in ordered[1:]:
            last = groups[-1][-1]
            if any(
                self._least_between(k, last, place, sign) < least for k in range(last.piece, place.piece + 1)
            ):
                groups.append([place])
            else:
                groups[-1].append(place)
        return groups

    def _least_between(self, k: int, one: Place, other: Place, sign: int) -> float:
        """Return the least value between two points on interval k (sign 1), or minus the greatest value (sign -1)."""
        low = self._local(k, one.s) if k == one.piece else -1.0
        high = self._local(k, other.s) if k == other.piece else 1.0
        return float((sign * legendre.legval(low + (high - low) * _BETWEEN, self._series[k])).min())

    def _representative(self, group: list[Place], sign: int) -> Place:
        """Return one point of a group of equal extrema; constant parts and ends of segments come before others."""
        best = max(sign * place.value for place in group)
        near = [place for place in group if sign * place.value >= best - _SAME * self.size]
        return max(near, key=lambda place: (place.where == HELD, place.where != INSIDE, sign * place.value))

    def refuse_jumps(self) -> None:
        """Raise `UsageError` if the quantity jumps between two events of the run."""
        if (np.ptp(self._rough(), axis=1) > _JUMPS * self.size).any():
            raise UsageError(
                f"{self.name} jumps, or varies too fast, between two events of the run, so its integral has "
                "no known derivative",
                remedy=_REMEDY,
            )

    def _at(self, k: int, local: float) -> float:
        """Convert a coordinate between -1 and 1 on interval k to the local time in its segment."""
        return float(self._begins[k] + 0.5 * self._orbit.lengths[k] * (1.0 + local))

    def _local(self, k: int, s: float) -> float:
        """Convert a local time to a coordinate between -1 and 1 on interval k."""
        return float(np.clip(2.0 * (s - self._begins[k]) / self._orbit.lengths[k] - 1.0, -1.0, 1.0))

    def _is_between(self, number: int, s: float) -> bool:
        return self._first < (number, s) < self._last

    def _turns(self, sign: int) -> list[Place]:
        """List the local extrema of a quantity, inside the intervals and at their common ends."""
        turns, orbit, found = self._orbit.turns, self._orbit, []
        for k, t, value, is_minimum in zip(
            turns.piece.tolist(), turns.t.tolist(), turns.value.tolist(), turns.is_minimum, strict=True
        ):
            number, s = int(orbit.segments[k]), self._begins[k] + (t - orbit.starts[k])
            if is_minimum == (sign < 0) and orbit.is_smooth[k, 0] and self._is_between(number, s):
                found.append(Place(number, float(s), INSIDE, value, k))
        for k in self._inside:
            number, s = int(orbit.segments[k]), self._at(k, 1.0)
            if (
                k + 1 < len(orbit.segments)
                and orbit.segments[k + 1] == number
                and self._is_between(number, s)
                and orbit.is_smooth[k : k + 2, 0].all()
                and sign * self._slope(k, 1.0) >= 0.0 >= sign * self._slope(k + 1, -1.0)
            ):
                found.append(Place(number, s, INSIDE, self._value(k, 1.0), k))
        return found

    def _ends(self, sign: int) -> list[Place]:
        """Return those ends of each segment at which a quantity may be greatest (sign 1) or least (sign -1)."""
        orbit, found = self._orbit, []
        numbers = orbit.segments[self._inside]
        for number in np.unique(numbers).tolist():
            own = np.array(self._inside)[numbers == number]
            segment = self._segments[number]
            for k, end, limit, where in (
                (int(own[0]), -1, self._first, START),
                (int(own[-1]), 1, self._last, END),
            ):
                knot = float(segment.s[0 if end < 0 else -1])
                s = limit[1] if number == limit[0] else knot
                local = self._local(k, s)
                if orbit.is_smooth[k, 0] and end * sign * self._slope(k, local) >= 0.0:
                    found.append(Place(number, s, where if s == knot else INSIDE, self._value(k, local), k))
        return found

    def _plateaus(self) -> list[Place]:
        """Return points of the intervals on which the quantity is constant."""
        orbit = self._orbit
        return [
            Place(int(orbit.segments[k]), self._at(k, local), HELD, value, int(k))
            for k in self._inside
            if not orbit.is_smooth[k, 0] and np.ptp(orbit.values[k, :, 0]) == 0.0
            for local, value in zip(NODES.tolist(), orbit.values[k, :, 0].tolist(), strict=True)
            if self._is_between(int(orbit.segments[k]), self._at(k, local))
        ]

    def _rough(self) -> np.ndarray:
        """Return the sampled values (k, POINTS) on intervals on which no polynomial is accurate."""
        values = self._orbit.values[self._inside, :, 0]
        is_rough = ~self._orbit.is_smooth[self._inside, 0] & (np.ptp(values, axis=1) != 0.0)
        return np.asarray(values[is_rough])

    def _slope(self, k: int, local: float) -> float:
        return float(legendre.legval(local, _SLOPE @ self._series[k]))

    def _value(self, k: int, local: float) -> float:
        return float(legendre.legval(local, self._series[k]))
