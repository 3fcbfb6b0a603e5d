"""Codes of functions, such as exponentials, that may vanish in a series although they change later."""

from __future__ import annotations

from hybridsim.engine.native.kernels import inlined

HYPERBOLIC, EXPONENTIAL, ROOT, KINDS = range(4)


MAX_POWER = 64  # largest power that is distinguished


@inlined
def register_of(number: int) -> int:
    """Return the register in a code made by `hybridsim.engine.system.programs.mode_code.fading`."""
    return number // (KINDS * MAX_POWER)


@inlined
def power_of(number: int) -> int:
    """Return the largest power to which the fading function is raised."""
    return number // KINDS % MAX_POWER + 1
