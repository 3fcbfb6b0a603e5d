"""This module stores a multiple-precision run as segments of Taylor series."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hybridsim.reference.multiple_precision.expansion import Coefficients, value_at
from hybridsim.reference.multiple_precision.precision import Number, Precision


@dataclass(frozen=True)
class Segment:
    """The states over [t, t + h] as Taylor series in the time since t."""

    t: Number
    h: Number
    states: tuple[Coefficients, ...]


@dataclass
class Motion:
    """The states of a run, as ``motion(times, side)`` in double or ``motion.state(t)`` in full precision.

    Parameters
    ----------
    last : states (n,) after the events at the end.
    """

    precision: Precision
    segments: list[Segment] = field(default_factory=list)
    last: tuple[Number, ...] = ()

    def __call__(self, times: NDArray[np.float64], side: str = "+") -> NDArray[np.float64]:
        """Return states (n, k) at times (k,); at an event, "+" gives the state after and "-" the state before it.

        The segment is chosen by times rounded to doubles, like the times of the events.
        """
        times = np.asarray(times, dtype=float)
        states = np.empty((len(self.last), len(times)))
        index = np.searchsorted(self._starts, times, side="right" if side == "+" else "left") - 1
        for i in np.unique(index):
            here = index == i
            segment = self.segments[max(int(i), 0)]
            states[:, here] = self._values(segment, times[here])
        if side == "+":
            states[:, times >= self._end] = np.array([float(value) for value in self.last])[:, None]
        return states

    def state(self, t: float | Number, side: str = "+") -> tuple[Number, ...]:
        """Return the states at a time in full precision."""
        t = self.precision.number(t)
        past = [segment for segment in self.segments if (segment.t <= t if side == "+" else segment.t < t)]
        if side == "+" and t >= self.segments[-1].t + self.segments[-1].h:
            return self.last
        segment = past[-1] if past else self.segments[0]
        return tuple(value_at(c, t - segment.t) for c in segment.states)

    @cached_property
    def _starts(self) -> NDArray[np.float64]:
        return np.array([float(segment.t) for segment in self.segments])

    @cached_property
    def _end(self) -> float:
        return float(self.segments[-1].t + self.segments[-1].h)

    def _values(self, segment: Segment, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Evaluate a segment at fractions of its step by Horner's scheme, in double precision."""
        high = float(segment.t)
        low = float(segment.t - high)
        fraction = np.clip(((times - high) - low) / float(segment.h), 0.0, 1.0) if segment.h else 0.0 * times
        rows = []
        for c in segment.states:
            scaled, power = [], self.precision.context.one
            for value in c:
                scaled.append(float(value * power))
                power = power * segment.h
            total = np.full(len(times), scaled[-1])
            for value in reversed(scaled[:-1]):
                total = total * fraction + value
            rows.append(total)
        return np.array(rows).reshape(len(segment.states), len(times))
