"""This module encodes functions, such as exponentials, that may be below rounding except in a narrow pulse."""

from __future__ import annotations

from hybridsim.engine.native.kernels import inlined

HYPERBOLIC, EXPONENTIAL, ROOT, KINDS = range(4)


MAX_POWER = 64  # largest power that is distinguished


@inlined
def register_of(number: int) -> int:
    """Return the number of the register in the code of a function that may fall below rounding."""
    return number // (KINDS * MAX_POWER)


@inlined
def power_of(number: int) -> int:
    """Return the power in the code of a function that may fall below rounding."""
    return number // KINDS % MAX_POWER + 1
