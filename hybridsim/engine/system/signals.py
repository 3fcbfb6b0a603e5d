"""This module evaluates inputs at run time: the present interval of a table, wave or chirp."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from fractions import Fraction

import numpy as np

from hybridsim.engine.series.layout import SIGNAL_SLOTS
from hybridsim.engine.system.instant import Instant, later, multiple, multiples
from hybridsim.errors import ModelError
from hybridsim.expr import evaluate
from hybridsim.model.parts.inputs import Input

_TWO_PI = 2.0 * math.pi
# knots of a wave as fractions of its period, with (value, slope per period) just after each knot
_SHAPES = {"triangle": ((-0.25, -1.0, 4.0), (0.25, 1.0, -4.0)), "sawtooth": ((0.0, -1.0, 2.0),)}


class Signal:
    """One input with its parameter values: its knots, and its coefficients between the knots."""

    def __init__(self, declared: Input, values: Mapping[str, float]) -> None:
        self.kind = declared.kind
        self.shape = declared.shape
        self._number = {name: evaluate(e, values) for name, e in declared.expressions.items()}
        if self.kind == "table":
            self._knots, self._coefficients = _table(declared, self._number.get("phase", 0.0))
            self._rows: np.ndarray | None = None  # the knots and the pieces, made at first use
        elif self.kind == "step":
            self._first, self._turns, self._period = step_turns(self._number, declared)
        elif self.kind == "wave" and self.shape != "sine":
            duty = self._number.get("duty", 0.5)
            square = ((0.0, 1.0, 0.0), (duty, -1.0, 0.0))
            self.corners = square if self.shape == "square" else _SHAPES[str(self.shape)]

    def piece(self, origin: Instant, forward: bool) -> tuple[float, ...]:
        """Return the five numbers that describe an input just after an instant, or just before it in a backward run."""
        if self.kind == "table":
            return self._table_piece(origin, forward)
        if self.kind == "step":
            return (self._step_value(origin, forward), 0.0, 0.0, 0.0, 0.0)
        if self.kind == "chirp":
            return self._chirp_piece(origin, forward)
        if self.shape == "sine":  # the lowered expressions contain all but the angle at t = 0
            turns = Fraction(self._number["phase"]) / Fraction(self._number["period"])
            return (_TWO_PI * float(round(turns) - turns), *(0.0,) * (SIGNAL_SLOTS - 1))
        return self._wave_piece(origin, forward)

    def sine(self, t: float) -> float:
        """Return the value of a sine wave at time t: offset + amplitude sin(2 pi (t - phase)/period)."""
        number = self._number
        turns = (Fraction(t) - Fraction(number["phase"])) / Fraction(number["period"])
        return number["offset"] + number["amplitude"] * math.sin(_TWO_PI * float(turns - round(turns)))

    def next_knot(self, after: Instant, forward: bool) -> Instant | None:
        """Return the next knot in the direction of time, or None if no knot follows an instant."""
        if self.kind == "table":
            # pairs compare in order of time, so bisection works for long tables
            index = bisect_right(self._knots, after) if forward else bisect_left(self._knots, after) - 1
            return self._knots[index] if 0 <= index < len(self._knots) else None
        if self.kind == "chirp":
            end = Instant(self._number["duration"])
            candidates = [Instant(0.0), end]
        elif self.kind == "step":
            candidates = [turn for turn, _ in self._step_turns(after)]
        elif self.shape == "sine":
            return None
        else:
            candidates = [knot for knot, _, _ in self._wave_knots(after)]
        ahead_of = [k for k in candidates if (k.minus(after) > 0.0 if forward else k.minus(after) < 0.0)]
        if not ahead_of:
            return None
        return min(ahead_of, key=float) if forward else max(ahead_of, key=float)

    @property
    def knots(self) -> Sequence[Instant]:
        """Return the knots of a table; other inputs have none."""
        return self._knots if self.kind == "table" else ()

    @property
    def is_polynomial(self) -> bool:
        """Return whether each piece is a polynomial of time, which is false for a chirp only; sines are expressions."""
        return self.kind != "chirp"

    def ahead(self, after: Instant, most: int) -> tuple[np.ndarray, np.ndarray]:
        """Return at most `most` next knots (m, 2) of an input, and its coefficients (m + 1, 6) between the knots.

        A piece is given by four coefficients and the instant from which its time is counted, or nan for a constant.
        """
        if self.kind == "table":
            return self._table_ahead(after, most)
        if self.shape == "sine":
            return np.zeros((0, 2)), np.array([(*self.piece(after, True)[:4], math.nan, math.nan)])
        knots, rows = self._repeated(after, most)
        first = int(np.count_nonzero((knots[:, 0] - after.high) + (knots[:, 1] - after.low) <= 0.0))
        if self.kind == "step":
            rows = np.vstack([[self._step_value(after, True), 0.0, 0.0, 0.0, math.nan, 0.0], rows[first:]])
        else:
            rows = rows[first - 1 :]  # a wave has knots before each instant
        return knots[first : first + most], rows[: min(most, len(knots) - first) + 1]

    def _table_ahead(self, after: Instant, most: int) -> tuple[np.ndarray, np.ndarray]:
        if self._rows is None:
            knots = np.array(self._knots)
            starts = np.concatenate([knots[:1], knots])
            self._rows = np.hstack([self._coefficients, starts])
        first = bisect_right(self._knots, after)
        rows = self._rows[first : first + most + 1]
        return self._rows[first + 1 : first + most + 1, 4:], rows

    def _repeated(self, after: Instant, most: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the knots (m, 2) of a wave or step around an instant, and its coefficients (m, 6) after each knot."""
        number = self._number
        if self.kind == "step":
            corners = [(time, (value, 0.0, 0.0, 0.0)) for time, value in self._turns]
            period, phase = self._period, 0.0
        else:
            scale, period, phase = number["amplitude"], number["period"], number["phase"]
            corners = [
                (fraction, (number["offset"] + scale * value, scale * slope / period, 0.0, 0.0))
                for fraction, value, slope in self.corners
            ]
        if not corners:
            return np.empty((0, 2)), np.empty((0, 6))
        k0 = math.floor((float(after) - phase) / period) - 2 if period else 0
        k = np.arange(k0, k0 + most // len(corners) + 7) if period else np.zeros(1)
        found = []
        for place, coefficients in corners:
            if self.kind == "step":
                knots = multiples(place, k, period)
            else:
                knots = later(multiples(phase, k, period), place * period)
            starts = np.full_like(knots, (math.nan, 0.0)) if self.kind == "step" else knots
            found.append((knots, np.hstack([np.tile(coefficients, (len(k), 1)), starts])))
        knots, rows = (np.concatenate(part) for part in zip(*found, strict=True))
        order = np.lexsort((knots[:, 1], knots[:, 0]))
        return knots[order], rows[order]

    def _step_turns(self, near: Instant) -> list[tuple[Instant, float]]:
        """Return the times near an instant at which a step input changes, each with the new value."""
        if self._period == 0.0:
            return [(Instant(time), value) for time, value in self._turns]
        k0 = math.floor(float(near) / self._period)
        return [
            (multiple(time, k, self._period), value)
            for k in range(k0 - 2, k0 + 3)
            for time, value in self._turns
        ]

    def _step_value(self, origin: Instant, forward: bool) -> float:
        behind = [
            turn
            for turn in self._step_turns(origin)
            if (turn[0].minus(origin) <= 0.0 if forward else turn[0].minus(origin) < 0.0)
        ]
        return max(behind, key=lambda turn: float(turn[0]))[1] if behind else self._first

    def _wave_knots(self, near: Instant) -> list[tuple[Instant, float, float]]:
        number = self._number
        k0 = math.floor((float(near) - number["phase"]) / number["period"])
        return [
            (multiple(number["phase"], k, number["period"]).plus(fraction * number["period"]), value, slope)
            for k in range(k0 - 2, k0 + 4)
            for fraction, value, slope in self.corners
        ]

    def _wave_piece(self, origin: Instant, forward: bool) -> tuple[float, ...]:
        number = self._number
        behind = [
            knot
            for knot in self._wave_knots(origin)
            if (knot[0].minus(origin) <= 0.0 if forward else knot[0].minus(origin) < 0.0)
        ]
        start, value, slope = max(behind, key=lambda knot: float(knot[0]))
        scale = number["amplitude"]
        return (
            number["offset"] + scale * value,
            scale * slope / number["period"],
            0.0,
            0.0,
            start.minus(origin),
        )

    def _table_piece(self, origin: Instant, forward: bool) -> tuple[float, ...]:
        index = (bisect_right if forward else bisect_left)(self._knots, origin)
        start = self._knots[max(index - 1, 0)].minus(origin)
        return (*self._coefficients[index], start)

    def _chirp_piece(self, origin: Instant, forward: bool) -> tuple[float, ...]:
        number = self._number
        t, end = _exact(origin), Fraction(number["duration"])
        f0, f1 = Fraction(number["f0"]), Fraction(number["f1"])
        bend = (f1 - f0) / (2 * end)
        before_start = t < 0 or (t == 0 and not forward)
        after_end = t > end or (t == end and forward)
        if before_start:
            turns, rate, bend_here = f0 * t, f0, Fraction(0)
        elif after_end:
            turns, rate, bend_here = f0 * end + bend * end * end + f1 * (t - end), f1, Fraction(0)
        else:
            turns, rate, bend_here = f0 * t + bend * t * t, f0 + 2 * bend * t, bend
        angle = number["phase"] + _TWO_PI * float(turns - round(turns))
        return (angle, _TWO_PI * float(rate), _TWO_PI * float(bend_here), number["amplitude"], 0.0)


def step_turns(
    number: Mapping[str, float], declared: Input
) -> tuple[float, list[tuple[float, float]], float]:
    """Return the initial value of a step input, the times and new values of its changes, and its period (or 0).

    Raises
    ------
    ModelError
        If the deciding expression is zero at all times.
    """
    shift, rate, amplitude = number["shift"], number["rate"], number.get("amplitude")
    if amplitude is None:
        if rate:
            return float(rate < 0.0), [(-shift / rate, float(rate > 0.0))], 0.0
        amplitude, number = 0.0, {"phase": 0.0}
    if rate == 0.0:
        shift, amplitude = shift + amplitude * math.sin(number["phase"]), 0.0
    if shift == amplitude == 0.0:
        title = getattr(declared, "title", declared.name)
        raise ModelError(
            f"'{title}' is zero at all times: a condition on its sign has no effect",
            remedy="correct the numbers, or write the intended branch without a condition",
        )
    if abs(shift) >= abs(amplitude):  # a wave that only touches zero has no sign change
        return float(shift > 0.0), [], 0.0
    # sin(phase + rate t) > -shift/amplitude between two angles, for a positive amplitude
    low = math.asin(-shift / amplitude)
    angles = ((low, float(amplitude > 0.0)), (math.pi - low, float(amplitude < 0.0)))
    forward = rate > 0.0
    turns = [((angle - number["phase"]) / rate, value if forward else 1.0 - value) for angle, value in angles]
    period = _TWO_PI / abs(rate)
    first, second = sorted((time % period, value) for time, value in turns)
    return second[1], [first, second], period


def _exact(instant: Instant) -> Fraction:
    return Fraction(instant.high) + Fraction(instant.low)


def _table(declared: Input, delay: float) -> tuple[list[Instant], list[tuple[float, float, float, float]]]:
    """Return the knots of a delayed table, and the cubic polynomials before, between and after the knots."""
    times, values = np.array(declared.times), np.array(declared.values)
    if declared.interpolation == "cubic":
        from scipy.interpolate import CubicSpline

        c = CubicSpline(times, values, bc_type="natural").c
        rows = [
            (float(c[3, i]), float(c[2, i]), float(c[1, i]), float(c[0, i])) for i in range(len(times) - 1)
        ]
    else:
        with np.errstate(divide="ignore", invalid="ignore"):
            slopes = np.where(np.diff(times) > 0.0, np.diff(values) / np.diff(times), 0.0)
        rows = [(float(v), float(m), 0.0, 0.0) for v, m in zip(values, slopes, strict=False)]
    first, last = (float(values[0]), 0.0, 0.0, 0.0), (float(values[-1]), 0.0, 0.0, 0.0)
    return [Instant(float(t)).plus(delay) for t in times], [first, *rows, last]
