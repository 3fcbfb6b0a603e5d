"""This module finds the steady motion of a forced mechanical system for `hybridsim.steady_state`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from hybridsim import arguments
from hybridsim.analysis.extrapolation import slight_slips
from hybridsim.analysis.extrapolation.settling import Settled, Settling
from hybridsim.analysis.steady.period_argument import require_multiple
from hybridsim.analysis.steady.quiet import middle_of_longest
from hybridsim.analysis.steady.settling import Passings
from hybridsim.analysis.steady.together import Effort
from hybridsim.analysis.structures.period_map import PeriodMap, forcing_period_of
from hybridsim.analysis.structures.result import StructureSteadyState
from hybridsim.analysis.structures.swept import model_to_sweep
from hybridsim.engine.native.compiler import announce_compilation
from hybridsim.errors import UsageError, nearest
from hybridsim.mechanics.declaration.system import MechanicalSystem
from hybridsim.mechanics.simulate import start_of

_NEAR = 1e-6  # of a period: an event this close to its end may be counted twice


def steady_state_of_structure(
    system: MechanicalSystem,
    effort: Effort,
    rtol: float,
    progress: Callable[[float], None] | None,
    *,
    params: Mapping[str, Any] | None,
    x0: Mapping[str, float] | Sequence[float] | None,
    period: float | None,
    integrator: str,
    **refused: Any,
) -> StructureSteadyState:
    """Find the steady motion of a mechanical system, as `hybridsim.steady_state` does for a model.

    Raises
    ------
    UsageError
        For arguments that a mechanical system does not support, or a system without a period.
    """
    _refuse(system, integrator, refused)
    if params is not None:
        system = model_to_sweep(system, params).system
    own = forcing_period_of(system)
    base = own if period is None else require_multiple(period, own, system.name)
    start = start_of(system, x0)
    announce_compilation()
    period_map = PeriodMap(system, base, start, arguments.relative_tolerance(rtol))
    return _result(period_map, Settling(period_map, *effort).run(progress), effort.tol)


def _result(period_map: PeriodMap, settled: Settled, tol: float) -> StructureSteadyState:
    passings, multiple, followed = settled.passings, settled.multiple or 1, period_map.periods
    residual = passings.residual(multiple)
    if settled.rests:
        kind, message = "equilibrium", "equilibrium: nothing moves"
    elif settled.multiple is not None:
        kind = "periodic"
        of = f" of {multiple} periods of the forcing" if multiple > 1 else ""
        residual, slight = slight_slips.after_slight_slips(
            period_map, multiple, residual, passings.scale, tol
        )
        message = f"periodic motion{of}; residual {residual:.1e}{slight_slips.message_of(slight)}"
    else:
        kind = "not settled"
        message = (
            f"not settled after {followed} periods: over the last one the states change by {residual:.1e}"
        )
        drifting = _drifting(passings)
        if drifting is not None:
            message += f", and {period_map.state_names[drifting]} drifts"
    run = period_map.recorded(multiple, 0.0)
    times = np.unique(run.changes[0])
    length = multiple * period_map.period
    inside = (times > _NEAR * length) & (times < (1.0 - _NEAR) * length)
    if len(times) and not inside.all():
        run = period_map.recorded(multiple, middle_of_longest(np.sort(times % length), length))
    return StructureSteadyState(run, kind, multiple, residual, followed, message)


def _drifting(passings: Passings) -> int | None:
    """Return the index of a state that drifts beyond its range by equal amounts per period, or None."""
    i = passings.drifting()
    if i is None:
        return None
    return i if abs(passings.values[-1, i] - passings.values[0, i]) > passings.scale[i] else None


def _refuse(system: MechanicalSystem, integrator: str, options: Mapping[str, Any]) -> None:
    if system.impacts:
        raise UsageError(
            f"{system.name} has impacts, for which steady states are not supported",
            remedy="use hs.simulate with integrator='moreau' until the motion repeats",
        )
    name = arguments.integrator_name(integrator)
    if name not in ("auto", "taylor"):
        raise UsageError(
            f"`integrator` is {name!r}, but steady states of a MechanicalSystem are found with taylor",
            remedy="remove `integrator`, or use hs.steady_state(system.to_model(), ...)",
        )
    for option, value in options.items():
        if value is not None:
            known = ("params", "x0", "period", "rtol", "tol", "settle", "max_periods", "progress")
            raise UsageError(
                f"steady_state() does not support `{option}` for a MechanicalSystem",
                remedy=nearest(option, known, kind="arguments"),
            )
