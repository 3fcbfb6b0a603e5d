"""This module computes step lengths that can be added to the time without rounding."""

from __future__ import annotations

import math

from hybridsim.engine.native.kernels import inlined

# A length of fewer ulps of time than 2**10 changes by more than 2**-11 of itself when it is rounded.
_COARSE = 2.0**-42


@inlined
def on_the_grid(s: float, h: float) -> float:
    """Return the step length from s to the double nearest to s + h, or 0 if no such step exists.

    A step that is tried with one length and accepted with a length an ulp of time different is another step
    if a state moves far in an ulp. A length of few ulps is never rounded up, because a rejected step must be
    followed by a shorter one.
    """
    end = s + h
    if abs(h) < _COARSE * abs(end) and abs(end - s) > abs(h):
        # rounded away from s; three quarters of an ulp less give the previous double
        end = s + (h - math.copysign(0.75 * 2.0**-52 * abs(end), h))
    moved = end - s
    return moved if moved * h > 0.0 else 0.0
