"""This module computes the motion of a model in multiple precision, as a reference."""

from __future__ import annotations

from collections.abc import Callable

from hybridsim.errors import UsageError
from hybridsim.model import Model
from hybridsim.model.parts.component import Corner, WholeNumber
from hybridsim.model.smoothing.explicit_corners import smoothed
from hybridsim.reference.trajectory import Trajectory

# With fewer digits, rounding comes too close to the size that counts as zero; more take ever longer.
_MIN_DIGITS, _MAX_DIGITS = 20, 200


def multiple_precision_trajectory(
    model: Model,
    t_span: tuple[float, float],
    digits: int = 32,
    progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """Integrate a model by Taylor series in multiple precision, with event decisions independent of the engine.

    It reads only the declaration: expressions become series in mpmath numbers, an event is a guard's series
    passing zero downward, and the next modes are found by trial (`multiple_precision.settling` states the
    rules). It shares no event code with the engine, so that agreement is evidence for both. Corners inside a
    mode are components in both (`hybridsim.model.smoothing.explicit_corners`). The numbers are the doubles that the
    engine uses: parameters, initial values and times are evaluated in double precision first and are exact from there
    on.

    Parameters
    ----------
    t_span : (t0, t1), t1 > t0.
    digits : working digits; the result has nearly as many if the motion does not amplify errors.
    progress : called with the finished fraction of the span.

    Returns
    -------
    Trajectory. Its ``states`` is a `Motion`, whose method ``state(t)`` gives all digits. It ends early if a
    monitor or a schedule ends the run.

    Raises
    ------
    UsageError
        For unsupported features: flows or guards that jump inside a mode, motion along a surface of a general
        automaton, more than four coupled contacts at once, accumulating events, backward runs.
    SimulationError
        If the model has no unique motion, or a fatal guard ends it.

    When to use
    -----------
    As a reference that is independent of the engine's event code. A step takes a few milliseconds.
    """
    from hybridsim.reference.multiple_precision.precision import Precision
    from hybridsim.reference.multiple_precision.run import Run

    if not _MIN_DIGITS <= digits <= _MAX_DIGITS:
        raise UsageError(
            f"`digits` cannot be {digits!r}", remedy=f"use a number from {_MIN_DIGITS} to {_MAX_DIGITS}"
        )
    if model.surfaces:
        names = ", ".join(surface.name for surface in model.surfaces)
        raise UsageError(
            f"model {model.name} has switching surfaces ({names}): the multiple-precision run does not support sliding",
            remedy="compare with another integrator at a tight tolerance, or with a closed form",
        )
    if model.impacts:
        names = ", ".join(impact.name for impact in model.impacts)
        raise UsageError(
            f"model {model.name} has impacts ({names}): the multiple-precision run supports resets, not impulses",
            remedy="compare with another integrator at a tight tolerance, or with a closed form",
        )
    if not t_span[1] > t_span[0]:
        raise UsageError(
            f"`t_span` is {t_span}, but the multiple-precision run goes forward only", remedy="use t1 > t0"
        )
    model = smoothed(model.validate())
    if names := ", ".join(c.name for c in model.components if c.surface and c.surface.unique):
        raise UsageError(
            f"rates of model {model.name} jump ({names}): the multiple-precision run does not support sliding",
            remedy="compare with another integrator at a tight tolerance, or with a closed form",
        )
    if any(isinstance(component, WholeNumber) for component in model.components):
        raise UsageError(
            f"model {model.name} contains floor, mod or round, which the multiple-precision run does not support",
            remedy="compare with another integrator at a tight tolerance, or with a closed form",
        )
    corners = {component.name for component in model.components if isinstance(component, Corner)}
    run = Run(model, t_span, Precision.of(digits), progress)
    run.follow()
    return Trajectory(
        states=run.motion,
        t_span=(t_span[0], float(run.now.point.t)),
        events=tuple(event for event in run.events if event.component not in corners),
        initial_modes={name: mode for name, mode in run.initial_modes.items() if name not in corners},
    )
