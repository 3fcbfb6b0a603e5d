"""This module gives one slip phase of a forced linear oscillator, including its end, in closed form.

x'' + c x' + k (x - centre) = F sin(angle + w s),      s is the time since the start of the phase
x(s) = centre + Re(own exp(rate s)) + Im(response exp(i (angle + w s)))
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

_TERMS = 24  # terms of the velocity's series for arguments up to 1/2; the first omitted term is below 1e-30
_MAX_STEPS = 100_000  # limit of the search for the end, which needs about fifty steps; only NaN exceeds it


class SlipPhase:
    """The motion from (x, v) at a forcing angle, in `direction` (+1 or -1).

    Stiffness, damping and force are per mass; the system is underdamped. The acceleration at the start is an
    argument, because after a release it is exactly zero, but a formula would only come close to zero.
    """

    def __init__(
        self,
        *,
        stiffness: float,
        damping: float,
        force: float,
        frequency: float,
        centre: float,
        direction: float,
        angle: float,
        x: float,
        v: float,
        acceleration: float,
    ) -> None:
        self.direction, self.angle, self.frequency, self.centre = direction, angle, frequency, centre
        self.natural = math.sqrt(stiffness)
        decay = damping / 2
        ringing = math.sqrt(stiffness - decay**2)
        self.rate = complex(-decay, ringing)
        self.response = force / complex(stiffness - frequency**2, damping * frequency) if force else 0j
        forced = self.response * cmath.exp(1j * angle)
        own_x, own_v = x - centre - forced.imag, v - frequency * forced.real
        self.own = complex(own_x, -(own_v + decay * own_x) / ringing)
        self.series = self._velocity_series(v, acceleration, force, damping, stiffness)
        self.series_reach = 0.5 / max(self.natural, frequency)

    def _velocity_series(
        self, v: float, acceleration: float, force: float, damping: float, stiffness: float
    ) -> Sequence[float]:
        """Return the Taylor coefficients of the velocity, which are exact even if v and v' start at zero."""
        w = self.frequency
        drive = [force * w * math.cos(self.angle), -force * w**2 * math.sin(self.angle)]
        derivatives = [v, acceleration]
        for n in range(_TERMS - 2):
            derivatives.append(drive[n % 2] - damping * derivatives[-1] - stiffness * derivatives[-2])
            drive[n % 2] *= -(w**2)
        return [value / math.factorial(n) for n, value in enumerate(derivatives)]

    def derivative(self, n: int, s: ArrayLike) -> NDArray[np.float64]:
        """Return the n-th derivative of the position; s may be an array."""
        s = np.asarray(s, dtype=float)
        own = self.rate**n * self.own * np.exp(self.rate * s)
        forced = (1j * self.frequency) ** n * self.response * np.exp(1j * (self.angle + self.frequency * s))
        return (own.real if n else self.centre + own.real) + forced.imag

    def bound(self, n: int, s: float) -> float:
        """Return a bound on the magnitude of the n-th derivative (n > 0) at all times after s."""
        own = abs(self.own) * math.exp(self.rate.real * s) * self.natural**n
        return own + abs(self.response) * self.frequency**n

    def time_to_rest(self, horizon: float) -> float | None:
        """Return the first s > 0 at which the velocity is zero, or None if this time is beyond the horizon.

        While the body moves, v + v' h - bound h^2 / 2 is a lower bound of the velocity. A step to the zero of
        this bound therefore passes no zero of the velocity, and near the first zero it becomes Newton's step.
        """
        v, acceleration, half_jerk = self.series[:3]
        if v != 0:
            s = 0.0
        elif acceleration != 0:  # the body moves up to twice this
            s = abs(acceleration) / self.bound(3, 0.0)
        else:  # a tangential start: likewise
            s = 3 * abs(half_jerk) / self.bound(4, 0.0)
        for _ in range(_MAX_STEPS):
            v, slope = self._velocity_and_slope(s)
            if v <= 0:
                return s
            curvature = self.bound(3, s)
            root = math.sqrt(slope**2 + 2 * curvature * v)
            step = (slope + root) / curvature if slope > 0 else 2 * v / (root - slope)
            s += step
            if s > horizon:
                return None
            if step <= 2 * math.ulp(s):
                return s
        raise ArithmeticError(
            f"no end was found for the slip phase that starts at the forcing angle {self.angle}"
        )

    def _velocity_and_slope(self, s: float) -> tuple[float, float]:
        """Return the velocity and its slope in the direction of the slip."""
        v = slope = 0.0
        if s > self.series_reach:
            v, slope = float(self.derivative(1, s)), float(self.derivative(2, s))
        else:
            for coefficient in reversed(self.series):
                slope = slope * s + v
                v = v * s + coefficient
        return self.direction * v, self.direction * slope
