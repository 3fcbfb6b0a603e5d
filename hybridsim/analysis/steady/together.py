"""This module finds steady motions in compiled code, for models with only contacts, linear modes and forcing.

What compiled code cannot decide is left to `hybridsim.analysis.steady.steady_state`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hybridsim.analysis.steady.motion import Motion, Point
from hybridsim.analysis.steady.result import SteadyState
from hybridsim.analysis.steady.shooting import Orbit
from hybridsim.engine.system.system import System
from hybridsim.engine.system.system_cache import system_of

if TYPE_CHECKING:
    from hybridsim.ensemble.orbits import Orbits

PERIODIC, EQUILIBRIUM = "periodic", "equilibrium"


class Effort(NamedTuple):
    """The settings of a search: tolerance, number of periods before the first test, and largest number of periods."""

    tol: float = 1e-10
    settle: int = 32
    max_periods: int = 4096


def effort_of(options: Mapping[str, Any]) -> Effort | None:
    """Read the settings of a search from the options of `steady_state`; return None if a setting is not valid."""
    effort = Effort(**{name: options[name] for name in Effort._fields if name in options})
    counts = (effort.settle, effort.max_periods)
    is_valid = isinstance(effort.tol, float) and 0.0 < effort.tol < 1.0
    return effort if is_valid and all(type(count) is int and count > 0 for count in counts) else None


def can_be_compiled(system: System, options: Mapping[str, Any]) -> bool:
    """Return whether compiled code can search the steady motions of a model from the model's own start.

    options: those of `steady_state`. A period or a start, for example, needs the general search.
    """
    from hybridsim.ensemble.group import can_run_together

    chosen = {name for name, value in options.items() if value is not None}
    return (
        options.get("integrator", "auto") in ("auto", "exact")
        and chosen <= {"integrator", "rtol", *Effort._fields}
        and can_run_together(system)
    )


def steady_motions(
    system: System,
    parameters: np.ndarray,
    starts: np.ndarray,
    effort: Effort,
    may_continue: Callable[[], bool],
) -> Iterator[Orbits]:
    """Yield steady motions at the points for which compiled code can find them; see `steady_orbits`."""
    from hybridsim.ensemble.group import Ensemble
    from hybridsim.ensemble.orbits import steady_orbits

    return steady_orbits(Ensemble(system, may_continue), parameters, starts, *effort)


def settled(motion: Motion, effort: Effort) -> SteadyState | None:
    """Return the steady motion from the model's initial state, or None if compiled code cannot find it."""
    system = system_of(motion.model)
    parameters = np.array([list(system.values.values())])
    starts = system.start_state({})[None, :]
    for found in steady_motions(system, parameters, starts, effort, lambda: True):
        if len(found.numbers):
            motion.sizes = np.abs(found.summary.extremes[0]).max(axis=0)
            orbit = Orbit(
                Point(found.starts[0], np.zeros(0), {}, found.modes[0]),
                float(found.periods[0]),
                int(found.multiples[0]),
                float(found.residuals[0]),
                int(found.newton_steps[0]),
            )
            kind = EQUILIBRIUM if found.rests[0] else PERIODIC
            message, followed = message_of(kind, orbit, True), int(found.followed[0])
            return SteadyState(motion.unwatched(), kind, orbit, False, orbit.steps, followed, message, found)
    return None


def message_of(kind: str, orbit: Orbit, is_forced: bool) -> str:
    """Return the sentence about a motion that repeats or rests."""
    if kind == EQUILIBRIUM:
        return f"equilibrium: all motion is rounding; residual {orbit.residual:.1e}"
    what = f" of {orbit.multiple} periods of the forcing" if is_forced and orbit.multiple > 1 else ""
    return f"periodic motion{what}; residual {orbit.residual:.1e}"
