"""Kinds of functions whose series does not show what happens later, such as exponentials, and their numbers."""

from __future__ import annotations

from hybridsim.engine.native.kernels import inlined

HYPERBOLIC, EXPONENTIAL, ROOT, KINDS = range(4)


MAX_POWER = 64  # largest power that is distinguished


@inlined
def register_of(number: int) -> int:
    """Return the register to which a number of `hybridsim.engine.system.programs.mode_code.fading` belongs."""
    return number // (KINDS * MAX_POWER)


@inlined
def power_of(number: int) -> int:
    """Return the largest power to which the fading function is raised."""
    return number // KINDS % MAX_POWER + 1
