"""One-term harmonic balance of an oscillator with Coulomb friction: a viscous damper that takes as much work.

Over a cycle x = A sin, friction takes 4 mu N A, a damper pi c w A^2: c_eq = 4 mu N/(pi A w). With it the amplitude
follows from a linear oscillator, and c_eq from the amplitude; solved together, in F0/k and with f = mu N/F0:

    ((1 - r^2) A)^2 + (2 zeta r A + 4 f/pi)^2 = 1
"""

from __future__ import annotations

import math


def equivalent_viscous_amplitude(r: float, zeta: float, f: float) -> float:
    """A in F0/k; 0 where the friction is too large for any (f >= pi/4): then it says that nothing moves."""
    drag = 4.0 * f / math.pi
    if drag >= 1.0:
        return 0.0
    square, cross = (1.0 - r * r) ** 2 + (2.0 * zeta * r) ** 2, 2.0 * zeta * r * drag
    # the positive root of square A^2 + 2 cross A = 1 - drag^2, without a difference of equals
    return (1.0 - drag * drag) / (cross + math.sqrt(cross * cross + square * (1.0 - drag * drag)))
