"""This module defines states at a section, and runs from one passage of the section to later passages."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hybridsim import arguments
from hybridsim.analysis.steady.scales import coupled_sizes, stands_still
from hybridsim.engine.record.segments import Segment
from hybridsim.engine.run.headway import cost
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system_cache import system_of
from hybridsim.errors import SimulationError, UsageError
from hybridsim.model import Model
from hybridsim.model.smoothing.whole_numbers import with_whole_numbers
from hybridsim.simulate import simulate
from hybridsim.solution import Solution


@dataclass(frozen=True)
class Point:
    """The start of a run: time, states, discrete states and modes.

    x (n,), discrete (d,); numbers: the modes of all components, which determine the held states. Events
    exactly at the section have not happened yet. at: the time from which the forcing's phase is counted.
    """

    x: np.ndarray
    discrete: np.ndarray
    z: dict[str, str]
    numbers: np.ndarray
    at: float = 0.0

    @property
    def values(self) -> np.ndarray:
        """States and discrete states (n + d,)."""
        return np.concatenate([self.x, self.discrete])

    def moved(self, change: np.ndarray) -> Point:
        """Return a copy of the point with a change (n + d,) added to its states and discrete states."""
        n = len(self.x)
        return replace(self, x=self.x + change[:n], discrete=self.discrete + change[n:])


class CostsMore(Exception):
    """Raised when a run has reached its first cost limit; `reached` is the duration so far."""

    def __init__(self, reached: float) -> None:
        super().__init__(reached)
        self.reached = reached


class GrowsWithoutBound(SimulationError):
    """Raised if a run ended because a state grew without bound."""

    def __init__(self, name: str) -> None:
        super().__init__(f"the motion grows without bound: {name} has passed {_WITHOUT_BOUND:g}")


class CostsTooMuch(SimulationError):
    """Raised when a search has reached its cost limit."""

    def __init__(self) -> None:
        super().__init__(
            "no steady motion was found within the work limit. Declare a `duration` of several periods in the model, "
            "or pass `period`, a smaller `settle`, a larger `tol`, a stiff integrator such as rodas5p, or a larger "
            "`max_periods`, which also raises the work limit"
        )


_TELLING = 100
# A run is checked after this many steps or events, then after twice as many, and so on. It is abandoned if it
# has used this fraction of the time budget and would exceed the time budget at its pace.
_LOOK, _SHARE = {"steps": 20000, "events": 20000}, 0.05
# Approximate seconds: for carrying the derivative by one state through a step, for carrying all of them over
# a segment's end, and for a segment's end without derivatives.
_CARRIED, _CARRIED_OVER, _RENEWED = 1e-5, 5e-4, 2e-4
_WITHOUT_BOUND = 1e100  # in any unit; squares and products of such values overflow


class Motion:
    """Runs of one model with the same options.

    Parameters
    ----------
    model : the model with its parameters set.
    options : options of `simulate`: integrator, rtol and the like.
    first : x0 and z0 of a run from the model's start.
    progress : called from time to time during every run.
    """

    def __init__(
        self,
        model: Model,
        options: dict[str, Any],
        first: dict[str, Any] | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> None:
        if with_whole_numbers(model) is not model:
            raise UsageError(
                f"model {model.name} contains floor, mod or round: steady states, sections and Lyapunov exponents need "
                "derivatives through their jumps, which are not supported",
                remedy="use hs.simulate, or hs.sweep with `t_span`",
            )
        self.model, self.options, self.first = model, options, first or {}
        self.progress = progress
        self.names = [s.name for s in model.states]
        self.discrete = [d.name for d in model.discrete]
        self.sizes = np.zeros(len(self.names))  # sizes of the states (n,) along the last run
        # The allowed cost of all runs together, their cost so far (`hybridsim.engine.run.headway.cost`), and that
        # of the last run per unit of time. The cost is counted, not timed, so that a search ends at the same
        # place on every machine.
        self.time_budget, self._spent, self._pace = math.inf, 0.0, 0.0

    def unwatched(self) -> Motion:
        """Return a copy without the progress callback, for later runs."""
        motion = Motion(self.model, self.options, self.first)
        motion.sizes = self.sizes
        return motion

    @property
    def rtol(self) -> float:
        """Relative tolerance of the runs."""
        return arguments.relative_tolerance(self.options.get("rtol"))

    def coupled_sizes(self, point: Point) -> np.ndarray:
        """Return the sizes (n,) of the states at a point; see `hybridsim.analysis.steady.scales`."""
        system = system_of(self.model)
        return coupled_sizes(system, point.x, system.vector(Instant(point.at), point.discrete), point.numbers)

    def stands_still(self, point: Point) -> bool:
        """Return whether all rates at a point are zero within rounding errors."""
        system = system_of(self.model)
        p = system.vector(Instant(point.at), point.discrete)
        return stands_still(system, point.x, p, point.numbers, self.rtol)

    def _tolerances(self, start: Point, rtol: float) -> dict[str, Any]:
        """Return the absolute tolerances of a run. A state near zero gets its tolerance from the size of the motion."""
        if "atol" in self.options or all(state.nominal for state in self.model.states):
            return {}
        found = np.maximum(self.coupled_sizes(start), self.sizes)
        sizes = [s.nominal or size or 1.0 for s, size in zip(self.model.states, found.tolist(), strict=True)]
        return {"atol": [1e-3 * rtol * size for size in sizes]}

    def on_constraints(self, point: Point) -> Point:
        """Return the point after computing held states from their constraints at the model's parameters."""
        system = system_of(self.model)
        x = system.project(0.0, point.x, system.vector(Instant(0.0), point.discrete), point.numbers)
        return replace(point, x=x)

    def run(self, start: Point | None, duration: float, is_carried: bool = False, **options: Any) -> Solution:
        """Run from a point for a duration; the default point is the model's initial state at time 0.

        is_carried: derivatives will be carried along the run, so that their cost counts too.
        """
        settings: dict[str, Any] = dict(self.first) if start is None else {}
        if start is not None:
            settings |= self._tolerances(start, options.get("rtol", self.rtol))
            settings["x0"] = dict(zip(self.names + self.discrete, start.values.tolist(), strict=True))
            settings["z0"] = start.z or None
        begin = 0.0 if start is None else start.at
        self._spend(0.0, self._pace * float(duration))
        settings |= self.options | options
        is_limited = "limits" not in settings and self.time_budget < math.inf
        if is_limited:
            settings["limits"] = _LOOK
        with np.errstate(over="ignore", invalid="ignore"):  # a motion may grow without bound
            solution = simulate(self.model, (begin, begin + duration), progress=self.progress, **settings)
            while is_limited and solution.status == "limit":
                solution = self._longer(solution, duration, is_carried)
        spent = float(_cost_of(solution))
        is_long = solution.stats["steps"] >= _TELLING  # a few steps do not show how a longer run would go
        self._pace = spent / float(solution.t_end - begin) if is_long else 0.0
        self._spend(spent)
        if solution.status == "interrupted":  # an interrupted search has no result
            raise KeyboardInterrupt
        if solution.status == "limit" and "limits" in options:
            raise CostsMore(solution.t_end - begin)
        if solution.status != "finished":
            self._refuse_growth(solution)
            raise SimulationError(
                f"the run towards the steady state ended early ({solution.status}): {solution.message}"
            )
        return solution

    def _longer(self, solution: Solution, duration: float, is_carried: bool) -> Solution:
        """Continue a run that has reached its limits, by as many steps as before, within the cost limit."""
        spent, reached = _cost_of(solution), solution.t_end - solution.t_start
        spent += _cost_of_carrying(solution) if is_carried else 0.0
        if (
            spent >= _SHARE * self.time_budget
            and spent * duration > (self.time_budget - self._spent) * reached
        ):
            raise CostsTooMuch
        return solution.resume(
            limits={name: max(most, solution.stats[name]) for name, most in _LOOK.items()},
            progress=self.progress,
        )

    def carry(self, solution: Solution) -> None:
        """Add the cost of computing derivatives along a run to the cost so far."""
        self._spend(_cost_of_carrying(solution))

    def _spend(self, seconds: float, ahead: float = 0.0) -> None:
        self._spent += seconds
        if self._spent + ahead > self.time_budget:
            raise CostsTooMuch

    def _refuse_growth(self, solution: Solution) -> None:
        """Raise `GrowsWithoutBound` if a run failed because a state became too large."""
        last = np.abs(solution._segments[-1].x[-1]) if solution._segments else np.zeros(0)
        last = np.where(np.isfinite(last), last, np.inf)
        if last.max(initial=0.0) >= _WITHOUT_BOUND:
            raise GrowsWithoutBound(self.names[int(np.argmax(last))])


def _cost_of(solution: Solution) -> float:
    steps, events = solution.stats["steps"], solution.stats["events"]
    is_compiled = solution.stats["kernel_time"] > 0.0 and solution._of_model.record.taken_over is None
    ends = max(solution.stats["restarts"] - events, 0)
    return cost(0 if is_compiled else steps, steps if is_compiled else 0, events) + _RENEWED * ends


def _cost_of_carrying(solution: Solution) -> float:
    steps, ends = solution.stats["steps"], solution.stats["restarts"]
    return _CARRIED * (1 + solution._system.n) * steps + _CARRIED_OVER * ends


def point_at_end(solution: Solution) -> Point:
    """Return the point just before the end of a run."""
    return _point(solution, solution._segments[_last_with_length(solution)], side=-1)


def point_after_end(solution: Solution) -> Point:
    """Return the point at the end of a run, after any event there."""
    return _point(solution, solution._segments[-1], side=-1)


def point_at(solution: Solution, t: float) -> Point:
    """Return the point of a run just before time t."""
    index, _ = solution._of_model.segment_at(np.array([t]), "-")
    segment = solution._segments[int(index[0])]
    point = _point(solution, segment, side=-1)
    return replace(point, x=solution(t, side="-"))


def _last_with_length(solution: Solution) -> int:
    spans = solution._segments.spans()
    return int(np.flatnonzero(spans[:, 1] > spans[:, 0])[-1])


def _point(solution: Solution, segment: Segment, side: int) -> Point:
    system = solution._system
    modes = {
        a.name: a.modes[m]
        for a, m in zip(system.declared, segment.z.tolist(), strict=False)
        if not a.has_surface
    }
    return Point(np.array(segment.x[side]), np.array(system.discrete(segment.p)), modes, segment.z)
