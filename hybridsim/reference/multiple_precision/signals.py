"""This module represents an input by its current polynomial."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from typing import Any

from hybridsim.expr import evaluate
from hybridsim.model import Model
from hybridsim.model.parts.inputs import Input
from hybridsim.reference.multiple_precision.precision import Number, Precision

# (knot as a fraction of the period, value there, slope per period) of the piecewise linear waves
_CORNERS = {"triangle": ((-0.25, -1, 4), (0.25, 1, -4)), "sawtooth": ((0, -1, 2),)}


class Signal:
    """One input in multiple precision.

    On a piece it is p0 + p1 s + p2 s^2 + p3 s^3, with s the time since the knot of the piece. For a sine and
    a chirp this polynomial is the angle.
    """

    def __init__(self, model: Model, declared: Input, precision: Precision) -> None:
        self.name = declared.name
        self.declared = declared
        self.number = precision.number
        self.context = precision.context
        values = model.parameter_values()
        self.values = {
            name: self.number(evaluate(expr, values)) for name, expr in declared.expressions.items()
        }
        if declared.kind == "table":
            delay = self.values.get("phase", self.number(0))
            self._times = [self.number(knot) + delay for knot in declared.times]
            self._table = _cubics(declared, self._times, self.number)

    @property
    def angular(self) -> bool:
        """Return whether the current polynomial of the input is an angle."""
        return self.declared.kind == "chirp" or self.declared.shape == "sine"

    def piece(self, t: Number) -> tuple[Number, ...]:
        """Return the start and the four coefficients of the polynomial that the input follows at a time."""
        zero = self.number(0)
        if self.declared.kind == "table":
            index = bisect_right(self._times, t)
            return (self._times[max(index - 1, 0)], *self._table[index])
        if self.declared.kind == "chirp":
            return self._chirp_piece(t)
        if self.declared.shape == "sine":
            return (self.values["phase"], zero, 2 * self.context.pi / self.values["period"], zero, zero)
        corners = [corner for corner in self._corners(t) if corner[0] <= t]
        knot, value, slope = max(corners, key=lambda corner: corner[0])
        scale = self.values["amplitude"]
        slope = scale * slope / self.values["period"]
        return (knot, self.values["offset"] + scale * value, slope, zero, zero)

    def next_knot(self, t: Number) -> Number | None:
        """Return the first knot of the input after a time."""
        if self.declared.kind == "table":
            index = bisect_right(self._times, t)
            return self._times[index] if index < len(self._times) else None
        if self.declared.kind == "chirp":
            knots = [self.number(0), self.values["duration"]]
        elif self.declared.shape == "sine":
            return None
        else:
            knots = [corner[0] for corner in self._corners(t)]
        return min((knot for knot in knots if knot > t), default=None)

    def _corners(self, t: Number) -> list[tuple[Number, Any, Any]]:
        """Return the corners of a wave near a time."""
        period, phase = self.values["period"], self.values["phase"]
        shape = str(self.declared.shape)
        corners: Sequence[tuple[Any, Any, Any]]
        if shape == "square":
            corners = ((0, 1, 0), (self.values["duty"], -1, 0))
        else:
            corners = _CORNERS[shape]
        near = int(self.context.floor((t - phase) / period))
        return [
            (phase + (k + self.number(fraction)) * period, value, slope)
            for k in range(near - 2, near + 3)
            for fraction, value, slope in corners
        ]

    def _chirp_piece(self, t: Number) -> tuple[Number, ...]:
        turn, zero = 2 * self.context.pi, self.number(0)
        f0, f1, end, phase = (self.values[name] for name in ("f0", "f1", "duration", "phase"))
        bend = (f1 - f0) / (2 * end)
        if t < 0:
            return (zero, phase, turn * f0, zero, zero)
        if t < end:
            return (zero, phase, turn * f0, turn * bend, zero)
        return (end, phase + turn * (f0 * end + bend * end**2), turn * f1, zero, zero)


def _cubics(declared: Input, times: Sequence[Number], number: Any) -> list[tuple[Number, ...]]:
    """Return the cubic polynomials before the first knot, between knots, and after the last knot."""
    values, zero = [number(v) for v in declared.values], number(0)
    bends = _natural_bends(times, values, zero) if declared.interpolation == "cubic" else [zero] * len(times)
    rows = []
    for i in range(len(times) - 1):
        width = times[i + 1] - times[i]
        if width == 0:
            rows.append((values[i], zero, zero, zero))
            continue
        slope = (values[i + 1] - values[i]) / width - width * (2 * bends[i] + bends[i + 1]) / 6
        rows.append((values[i], slope, bends[i] / 2, (bends[i + 1] - bends[i]) / (6 * width)))
    ends = [(value, zero, zero, zero) for value in (values[0], values[-1])]
    return [ends[0], *rows, ends[1]]


def _natural_bends(times: Sequence[Number], values: Sequence[Number], zero: Number) -> list[Number]:
    """Return the second derivatives of the natural cubic spline at its knots."""
    n = len(times)
    diagonal, right = [zero] * n, [zero] * n
    for i in range(1, n - 1):
        left, ahead = times[i] - times[i - 1], times[i + 1] - times[i]
        factor = left / diagonal[i - 1] if i > 1 else zero
        diagonal[i] = 2 * (left + ahead) - factor * left
        jump = (values[i + 1] - values[i]) / ahead - (values[i] - values[i - 1]) / left
        right[i] = 6 * jump - factor * right[i - 1]
    bends = [zero] * n
    for i in range(n - 2, 0, -1):
        bends[i] = (right[i] - (times[i + 1] - times[i]) * bends[i + 1]) / diagonal[i]
    return bends
