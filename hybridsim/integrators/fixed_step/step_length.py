"""This module determines the length of a fixed step from a value or from the forcing period."""

from __future__ import annotations

import math

from hybridsim.engine.system.period import system_period
from hybridsim.engine.system.system import System
from hybridsim.errors import UsageError

_MAX_STEPS = 1e18  # thirty years at a nanosecond each; with fewer steps a monitor may still end the run


def fixed_step_length(
    system: System, step: float | None, period: float | None, steps_per_period: float, name: str
) -> float:
    """Return the fixed step: the given value, or the forcing period divided by the steps per period."""
    for label, value in (("step", step), ("period", period), ("steps_per_period", steps_per_period)):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise UsageError(f"{name}: `{label}` cannot be {value!r}", remedy="use a positive number")
    if step is not None:
        return step
    if period is None:
        period = system_period(system)
    if period is None:
        raise UsageError(
            f"{name} needs a step size, because model '{system.model.name}' has no forcing period",
            remedy="pass step=... or period=...",
        )
    return period / steps_per_period


def refuse_longer(step: float, max_step: float, name: str) -> None:
    """Raise an error for a fixed step longer than max_step, instead of shortening it silently."""
    if step > max_step:
        raise UsageError(
            f"`max_step` is {max_step:g}, but the fixed step of {name} is {step:g}",
            remedy="set `step` or `steps_per_period`",
        )


def refuse_endless(step: float, span: tuple[float, float], name: str) -> None:
    """Raise an error for steps so short that the run would not end in practice."""
    count = abs(span[1] - span[0]) / step
    if count > _MAX_STEPS:
        raise UsageError(
            f"`{name}` is {step!r}: a run from {span[0]:g} to {span[1]:g} would take {count:.0e} steps",
            remedy=f"use a larger step: a run with more than {_MAX_STEPS:.0e} steps would take too long",
        )
