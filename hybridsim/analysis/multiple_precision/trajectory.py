"""The trajectory of any declared model in multiple precision, for a comparison to be measured against."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from hybridsim.analysis.trajectory import Trajectory
from hybridsim.errors import UsageError
from hybridsim.model.component import Corner
from hybridsim.model.smoothing import smoothed

if TYPE_CHECKING:
    from hybridsim.model import Model

# Fewer digits than this leave nothing between rounding and what counts as zero; more take ever longer.
_FEWEST, _MOST = 20, 200


def multiple_precision_trajectory(
    model: Model,
    t_span: tuple[float, float],
    digits: int = 32,
    progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """Follow a model by Taylor series in multiple precision, deciding its events without the engine.

    It reads the declaration alone: expressions become series in mpmath numbers, an event is where a guard's series
    leaves zero downward, and what follows it is found by trying the modes (`multiple_precision.settling` has the rules
    in words). So it agrees with the engine only where both are right. Corners inside a mode are components in both
    (`hybridsim.model.smoothing`). Numbers are the doubles that the engine uses:
    parameters, initial values and times are worked out in double precision first and exact from there on.

    Parameters
    ----------
    t_span : (t0, t1), t1 > t0.
    digits : digits that are carried; what comes out is good to nearly as many where the motion does not amplify errors.
    progress : called with the fraction of the span that has been done.

    Returns
    -------
    Trajectory. Its ``states`` is a `Motion`, whose method ``state(t)`` gives all digits. It ends early where a monitor
    or a schedule ends the run.

    Raises
    ------
    UsageError
        Naming what is not supported: flows or guards that jump inside a mode, motion along a surface of a
        general automaton, more than four coupled contacts at once, events that accumulate, running backward in time.
    SimulationError
        Where the model has no unique motion, or a fatal guard ends it.

    When to use
    -----------
    As a reference that owes nothing to the engine's event code. A step takes some milliseconds.
    """
    from hybridsim.analysis.multiple_precision.precision import Precision
    from hybridsim.analysis.multiple_precision.run import Run

    if not _FEWEST <= digits <= _MOST:
        raise UsageError(f"digits is {digits!r}", remedy=f"give a number from {_FEWEST} to {_MOST}")
    if model.surfaces:
        names = ", ".join(surface.name for surface in model.surfaces)
        raise UsageError(
            f"model {model.name} has switching surfaces ({names}): the multiple-precision run does not slide",
            remedy="compare with another integrator at a tight tolerance, or with a closed form",
        )
    if model.impacts:
        names = ", ".join(impact.name for impact in model.impacts)
        raise UsageError(
            f"model {model.name} has impacts ({names}): the multiple-precision run knows resets, not impulses",
            remedy="compare with another integrator at a tight tolerance, or with a closed form",
        )
    if not t_span[1] > t_span[0]:
        raise UsageError(
            f"the multiple-precision run goes forward, and t_span is {t_span}", remedy="let t1 be after t0"
        )
    model = smoothed(model.validate())
    if names := ", ".join(c.name for c in model.components if c.surface and c.surface.unique):
        raise UsageError(
            f"model {model.name} jumps in a rate ({names}): the multiple-precision run does not slide",
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
