"""This module computes the next step size of a one-step method from the errors of the last steps."""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.native.kernels import kernel

# Step control of Hairer, Norsett and Wanner 1993, section II.4: safety factor and bounds of the change of a step.
SAFETY, SHRINK, GROW = 0.9, 0.2, 10.0
_LEAST = 1e-2  # smaller errors, as shares of the tolerance, are not used for extrapolation
SMALLEST = 10.0  # a remainder of fewer ulps of the local time is merged into the last step
# So is a remainder of less than this share of the step: thousands of equal steps add up to their span up to
# roundings of that size, and a step that is longer by it has the same error up to a part in 10**8.
LAST_STEP_FACTOR = 1.0 + 2.0**-30


@kernel
def forget(memory: Any) -> None:
    """Reset the memory of the step control: the last accepted step, its error, and a rejection flag."""
    memory[0], memory[1], memory[2] = 0.0, 0.0, 0.0


@kernel
def next_length(h: float, error: float, error_order: int, memory: Any) -> float:
    """Return the step size to try after a step of length `h` with a given scaled error.

    If errors have been growing from step to step, the growth is extrapolated (K. Gustafsson, ACM Transactions
    on Mathematical Software 20 (1994) 496, doi:10.1145/198429.198437). After a rejected step the length does
    not increase.
    """
    if not error <= 1.0:
        memory[2] = 1.0
        factor = SAFETY * error ** (-1.0 / error_order) if error < math.inf else SHRINK
        return h * min(1.0, max(SHRINK, factor))
    factor = GROW
    if error > 0.0:
        factor = SAFETY * error ** (-1.0 / error_order)
        if memory[0] > 0.0:
            trend = max(memory[1], _LEAST) / error
            factor = min(factor, factor * (h / memory[0]) * trend ** (1.0 / error_order))
    if memory[2] > 0.0:
        factor = min(factor, 1.0)
    memory[0], memory[1], memory[2] = h, error, 0.0
    return h * min(GROW, max(SHRINK, factor))
