"""This module gives Den Hartog's steady motion of an oscillator with Coulomb and viscous friction, without stops.

J. P. Den Hartog, Forced vibrations with combined Coulomb and viscous friction, Trans. ASME 53 (1931) 107.
Displacement is in F0/k, time in 1/wn; r = w/wn, f = mu N/F0. Over the half period in which the velocity is negative

    x = f + R cos(r s + psi) + exp(-zeta s) (a cos(kappa s) + b sin(kappa s)),    R = 1/|1 - r^2 + 2 i zeta r|

and the other half is its mirror image. Two linear equations give a and b, and the turning point gives psi.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

# Samples of the velocity over the half period. The velocity is smooth, and its maximum is interpolated
# between samples.
_SAMPLES = 801


def linear_amplitude(r: float, zeta: float) -> float:
    """Return the amplitude without friction, in units of F0/k."""
    return 1.0 / math.hypot(1.0 - r * r, 2.0 * zeta * r)


@dataclass(frozen=True)
class NoStops:
    """The symmetric motion with two turning points per period.

    amplitude : X in F0/k; nan if the friction is too large for the formula.
    holds : whether the velocity keeps its sign over the half period, so that this is the motion.
    """

    amplitude: float
    holds: bool


def no_stops(r: float, zeta: float, f: float) -> NoStops:
    """Return the motion without stops at a frequency ratio, a damping ratio (< 1) and a friction ratio."""
    R, (a, b), turning = linear_amplitude(r, zeta), *_free(r, zeta)
    sine = f * turning / (R * r)
    if abs(sine) > 1.0:
        return NoStops(math.nan, False)
    psi = math.asin(sine)
    amplitude = f * (1.0 + a) + R * math.cos(psi)
    kappa = math.sqrt(1.0 - zeta * zeta)
    s = math.pi / r * np.sin(0.5 * math.pi * np.linspace(0.0, 1.0, _SAMPLES)[1:-1]) ** 2  # dense at both ends
    decay = np.exp(-zeta * s)
    free = decay * ((b * kappa - a * zeta) * np.cos(kappa * s) - (a * kappa + b * zeta) * np.sin(kappa * s))
    velocity = f * free - R * r * np.sin(r * s + psi)
    # The velocity is zero at both ends. Divided by sin(r s), it tends to the acceleration at the turning
    # point over r.
    shape = velocity / np.sin(r * s)
    at_turning = (f * (-2.0 * zeta * turning - a) - R * r * r * math.cos(psi)) / r
    top = int(np.argmax(shape))
    highest = max(float(shape[top]), at_turning)
    # Use the parabola through the largest sample and its neighbours.
    if 0 < top < len(s) - 1 and shape[top] > at_turning:
        left, middle, right = shape[top - 1 : top + 2]
        bend = left - 2.0 * middle + right
        highest = float(middle - (right - left) ** 2 / (8.0 * bend)) if bend < 0.0 else highest
    return NoStops(amplitude, bool(amplitude > 0.0 and highest <= 0.0))


def _free(r: float, zeta: float) -> tuple[tuple[float, float], float]:
    """Return the coefficients (a, b) of the free vibration for f = 1, and its velocity at the turning point."""
    kappa = math.sqrt(1.0 - zeta * zeta)
    half = math.pi / r
    decay, c, s = math.exp(-zeta * half), math.cos(kappa * half), math.sin(kappa * half)
    # Conditions of symmetry: y(half) + y(0) = -2 and y'(half) + y'(0) = 0.
    equations = np.array(
        [
            [1.0 + decay * c, decay * s],
            [-zeta - decay * (zeta * c + kappa * s), kappa + decay * (kappa * c - zeta * s)],
        ]
    )
    a, b = np.linalg.solve(equations, [-2.0, 0.0])
    return (float(a), float(b)), float(b * kappa - a * zeta)


def largest_friction(r: float, zeta: float) -> float:
    """Return the friction ratio f = mu N/F0 up to which the motion does not stop, by bisection."""
    low, high = 0.0, 1.0
    while high - low > 1e-12:
        middle = 0.5 * (low + high)
        if no_stops(r, zeta, middle).holds:
            low = middle
        else:
            high = middle
    return low
