"""Whether a guard may be zero where a compiled loop has brought a run to its end."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.engine.jets import UNIT, run_series
from hybridsim.engine.jit import Door, kernel

if TYPE_CHECKING:
    from hybridsim.engine.leapt import Leapt
    from hybridsim.engine.system import System


@kernel
def is_near(
    constant_rows: Any,
    rows: Any,
    inputs: Any,
    derivatives: Any,
    watched: Any,
    start: Any,
    x: Any,
    x_error: Any,
    p: Any,
    s_error: float,
    steps: float,
    rounding: float,
    errors: Any,
    scratch: Any,
) -> bool:
    """Whether one of the registers that are watched is zero within what `located.before_appointment` allows it.

    start: the states so many steps before. scratch: errors (n,), (2, registers, 2).
    """
    V, E = scratch[0], scratch[1]
    run_series(constant_rows, rows, inputs, derivatives, 0.0, s_error, x, x_error, p, V, E)
    for i in range(x.shape[0]):
        way = abs(x[i] - start[i])
        scale = max(abs(start[i]), abs(x[i])) + way
        known = s_error * abs(V[derivatives[i], 0])
        errors[i] = x_error[i] + known + UNIT * ((4.0 + 16.0 * steps) * scale + rounding * way)
    run_series(constant_rows, rows, inputs, derivatives, 0.0, s_error, x, errors, p, V, E)
    for j in range(watched.shape[0]):
        if not abs(V[watched[j], 0]) > E[watched[j], 0]:
            return True
    return False


_is_near = Door(is_near)


def may_be_at_zero(system: System, leapt: Leapt, start: np.ndarray, rounding: float) -> bool:
    """Whether a guard may be zero at the end of a call that began with these states; most often it is for certain not.

    rounding: of the method, as located events have it.
    """
    end, time = leapt.end, leapt.clock[0]
    z = end.part("z")
    tape, registers = system.lean_tape(z), system.registers
    return bool(
        _is_near(
            tape.constant_rows, tape.rows, registers.inputs, tape.derivatives, tape.watched, start,
            end.part("x"), end.part("x_error"), end.part("p"), math.ulp(time), float(leapt.steps), rounding,
            np.empty(len(start)), np.empty((2, registers.count, 2)),
        )
    )  # fmt: skip
