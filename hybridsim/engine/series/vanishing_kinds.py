"""Kinds of functions whose series shows nothing of what comes, and their numbers."""

from __future__ import annotations

from hybridsim.engine.native.kernels import inlined

HYPERBOLIC, EXPONENTIAL, ROOT, KINDS = range(4)


MOST_POWER = 64  # that is told apart


@inlined
def register_of(number: int) -> int:
    """The register that a number of `hybridsim.engine.system.programs.mode_code.fading` is of."""
    return number // (KINDS * MOST_POWER)


@inlined
def power_of(number: int) -> int:
    """The power to which what fades is raised, at most: u times as much is the argument of what it comes to."""
    return number // KINDS % MOST_POWER + 1
