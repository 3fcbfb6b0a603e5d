"""This module determines the period of a model's forcing."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from hybridsim.expr import evaluate

if TYPE_CHECKING:
    from hybridsim.engine.system.system import System
    from hybridsim.model.parts.model import Model

# Ratios of periods closer than this to a whole number count as whole, because parameters are rounded.
_COMMENSURATE = 1e-9
_MAX_PERIOD_RATIO = 64  # longest common period, in units of the longest single period


def system_period(system: System) -> float | None:
    """Return the longest known period in the model if all other known periods divide it, else None."""
    periods = forcing_periods(system)
    return _multiple_of_all(periods, 1) if periods else None


def common_period(system: System) -> float | None:
    """Return the time after which all forcing, inputs and clocks repeat, or None."""
    return common_multiple(all_periods(system))


def common_multiple(periods: list[float]) -> float | None:
    """Return the least multiple of the longest period that is a multiple of all other periods, or None."""
    return _multiple_of_all(periods, _MAX_PERIOD_RATIO) if periods else None


def all_periods(system: System) -> list[float]:
    """Return the periods of all forcing, inputs and clocks, or an empty list if one has no period."""
    periods = forcing_periods(system)
    if periods is None:
        return []
    values = system.values
    return periods + [evaluate(c.period, values) for c in system.model.schedules if c.period is not None]


def forcing_periods(system: System) -> list[float] | None:
    """Return the period of each sine of time and of each input, or None if one has no period."""
    values = system.values
    periods = [2.0 * math.pi / abs(float(rate)) for rate in system.rates if rate != 0.0]
    for declared in system.model.inputs:
        if declared.period is None:
            return None
        periods.append(evaluate(declared.period, values))
    return periods


def _multiple_of_all(periods: list[float], most: int) -> float | None:
    longest = max(periods)
    for k in range(1, most + 1):
        ratios = [k * longest / period for period in periods]
        if all(abs(r - round(r)) <= _COMMENSURATE * r for r in ratios):
            return k * longest
    return None


def forcing_period(model: Model) -> float | None:
    """Return the period of a model's forcing at its parameter values, or None if there is no single period."""
    from hybridsim.engine.native.compiler import announce_compilation
    from hybridsim.engine.system.system import System

    announce_compilation()
    return system_period(System(model))
