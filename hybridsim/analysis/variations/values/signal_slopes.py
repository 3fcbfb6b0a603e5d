"""This module computes derivatives of inputs with respect to parameters, including the times of their knots."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from hybridsim.analysis.variations.values.parameters import expression_slope
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.signals import Signal
from hybridsim.expr import evaluate
from hybridsim.model.parts.inputs import Input

_TWO_PI = 2.0 * math.pi


class SignalSlopes:
    """Derivatives of one input along Q directions.

    Parameters
    ----------
    values, slopes : values of all names of its expressions, and their derivatives (Q,).
    """

    def __init__(
        self,
        declared: Input,
        signal: Signal,
        values: Mapping[str, float],
        slopes: Mapping[str, np.ndarray],
        width: int,
    ) -> None:
        self.declared, self.signal, self.width = declared, signal, width
        self._value = {name: evaluate(e, values) for name, e in declared.expressions.items()}
        self._slope = {
            name: expression_slope(e, values, slopes, width) for name, e in declared.expressions.items()
        }
        self.is_fixed = not any(each.any() for each in self._slope.values())

    def coefficients(self, origin: float, slots: np.ndarray) -> np.ndarray:
        """Return the derivatives (5, Q) of the coefficients that describe an input just after an instant."""
        found, kind, d, v = np.zeros((len(slots), self.width)), self.declared.kind, self._slope, self._value
        if kind == "wave" and self.declared.shape == "sine":
            found[0] = -_TWO_PI * (d["phase"] - v["phase"] / v["period"] * d["period"]) / v["period"]
        elif kind == "wave":
            _, value, slope = self._corner(origin + slots[4])
            found[0] = d["offset"] + value * d["amplitude"]
            found[1] = (slope * d["amplitude"] - slots[1] * d["period"]) / v["period"]
            found[4] = self._wave_knot(origin + slots[4])
        elif kind == "chirp":
            found[:4] = self._chirp(origin, bool(slots[2]))
        elif kind == "table" and "phase" in d:
            found[4] = d["phase"]
        return found

    def knot(self, t: Instant) -> np.ndarray:
        """Return the derivatives (Q,) of the time of the knot at an instant."""
        d, v, time = self._slope, self._value, float(t)
        if self.declared.kind == "chirp" and abs(time - v["duration"]) <= abs(time):
            return d["duration"]
        if self.declared.kind == "wave" and self.declared.shape != "sine":
            return self._wave_knot(time)
        if self.declared.kind == "table" and "phase" in d:
            return d["phase"]
        if self.declared.kind == "step":
            by = d["shift"] + (time * d["rate"] if "amplitude" not in v else 0.0)
            rate = v["rate"]
            if "amplitude" in v:  # shift + amplitude sin(phase + rate t) is zero at the knot
                angle = v["phase"] + rate * time
                by = by + math.sin(angle) * d["amplitude"]
                by = by + v["amplitude"] * math.cos(angle) * (d["phase"] + time * d["rate"])
                rate = rate * v["amplitude"] * math.cos(angle)
            return np.asarray(-by / rate)
        return np.zeros(self.width)

    def _corner(self, t: float) -> tuple[float, float, float]:
        """Return the corner of a wave nearest to time t: fraction of the period, value, and slope after it."""
        periods = (t - self._value["phase"]) / self._value["period"]
        return min(self.signal.corners, key=lambda corner: abs(math.remainder(periods - corner[0], 1.0)))

    def _wave_knot(self, t: float) -> np.ndarray:
        d, v = self._slope, self._value
        found = d["phase"] + (t - v["phase"]) / v["period"] * d["period"]
        if self.declared.shape == "square" and self._corner(t)[0] != 0.0:
            found = found + v["period"] * d["duty"]
        return found

    def _chirp(self, t: float, is_inside: bool) -> np.ndarray:
        """Return the derivatives (4, Q) of the angle of a chirp, its first and second derivative, and its amplitude."""
        d, v = self._slope, self._value
        end, rise = v["duration"], v["f1"] - v["f0"]
        d_rise = d["f1"] - d["f0"]
        bend = 0.5 * (d_rise / end - rise / end**2 * d["duration"])
        zero = np.zeros(self.width)
        if is_inside:
            turns, rate = d["f0"] * t + bend * t * t, d["f0"] + 2.0 * bend * t
        elif t < 0.5 * end:
            turns, rate, bend = d["f0"] * t, d["f0"], zero
        else:  # f0 D + (f1 - f0) D/2 + f1 (t - D)
            by_end = 0.5 * (v["f0"] + v["f1"]) - v["f1"]
            turns = 0.5 * end * (d["f0"] + d["f1"]) + d["f1"] * (t - end) + by_end * d["duration"]
            rate, bend = d["f1"], zero
        angle = d["phase"] + _TWO_PI * turns
        return np.array([angle, _TWO_PI * rate, _TWO_PI * bend, d["amplitude"]])
