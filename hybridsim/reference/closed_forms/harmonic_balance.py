"""This module gives the one-term harmonic balance of an oscillator with Coulomb friction.

Over a cycle x = A sin, friction does the work 4 mu N A and a damper pi c w A^2, so that c_eq = 4 mu N/(pi A w). The
amplitude of the linear oscillator with c_eq and this equation are solved together, in F0/k and with f = mu N/F0:

    ((1 - r^2) A)^2 + (2 zeta r A + 4 f/pi)^2 = 1
"""

from __future__ import annotations

import math


def equivalent_viscous_amplitude(r: float, zeta: float, f: float) -> float:
    """Return the amplitude A in F0/k, or 0 if friction is too large for a vibration (f >= pi/4)."""
    drag = 4.0 * f / math.pi
    if drag >= 1.0:
        return 0.0
    square, cross = (1.0 - r * r) ** 2 + (2.0 * zeta * r) ** 2, 2.0 * zeta * r * drag
    # the positive root of square A^2 + 2 cross A = 1 - drag^2, in a form without cancellation
    return (1.0 - drag * drag) / (cross + math.sqrt(cross * cross + square * (1.0 - drag * drag)))
