"""The period of a model's forcing, where it has one."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from hybridsim.expr import evaluate

if TYPE_CHECKING:
    from hybridsim.engine.system import System
    from hybridsim.model.model import Model

# Ratios of periods that differ from a whole number by less than this are whole: parameters carry rounding.
_COMMENSURATE = 1e-9


def system_period(system: System) -> float | None:
    """Period of everything that varies in time in a known way: the longest, if the others divide it; else None."""
    values = system.values
    periods = [2.0 * math.pi / abs(float(rate)) for rate in system.rates if rate != 0.0]
    for declared in system.model.inputs:
        if declared.kind != "wave" or declared.period is None:
            return None
        periods.append(evaluate(declared.period, values))
    if not periods:
        return None
    longest = max(periods)
    ratios = [longest / period for period in periods]
    return longest if all(abs(r - round(r)) <= _COMMENSURATE * r for r in ratios) else None


def forcing_period(model: Model) -> float | None:
    """Period of a model's forcing at its parameter values, or None where it has no single one."""
    from hybridsim.engine.jit import announce_compilation
    from hybridsim.engine.system import System

    announce_compilation()
    return system_period(System(model))
