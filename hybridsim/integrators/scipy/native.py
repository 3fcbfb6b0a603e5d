"""This module uses the event location of SciPy's `solve_ivp`, called again after each event."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from hybridsim.engine.run.stepping import Flow, Root, Step, Watch
from hybridsim.engine.system.failures import StepFailure
from hybridsim.engine.system.period import system_period
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.integrators.scipy.stepper import dense_of

# While a mode holds all states, only the event functions depend on the forcing, and a step may grow over
# whole periods of it. Experienced users limit the step; this class does so, too.
_STEPS_PER_PERIOD = 10
_DIRECTIONS = {"up": 1.0, "down": -1.0, "both": 0.0}


class NativeStepper:
    """One call of `solve_ivp` for a whole segment, whose result is returned step by step.

    Its limitations are those of `solve_ivp`:

    - the sign of an event function is tested only at both ends of a step, so that two zeros in one step are
      missed;
    - the test includes both ends: a function that is zero at the start of a segment and falls fires there,
      even if only its rounding error falls;
    - a zero is found on the dense output, which may be less accurate than the method.

    The guards of the mode are terminal events with direction -1; monitors that only record are not terminal.
    Without ``max_step`` a step is at most a tenth of the forcing's period.
    """

    def __init__(
        self,
        solver_class: Any,
        implicit: bool,
        flow: Flow,
        x0: np.ndarray,
        bound: float,
        tolerances: Tolerances,
        first_step: float | None,
        watch: Watch,
    ) -> None:
        from scipy.integrate import solve_ivp

        self.flow = flow
        system = flow.system
        # the argument of a corner may stay at zero, which the sign test treats as an event at every step
        still = system.is_corner[system.owner[watch.guards]] & (watch.sides[watch.guards] == 0)
        guards = [int(g) for g in watch.guards[~still]]
        monitors = list(range(len(watch.monitor_sides)))
        events = [self._guard(g) for g in guards] + [self._monitor(k) for k in monitors]
        longest, period = tolerances.max_step, system_period(flow.system)
        if np.isinf(longest) and period:
            longest = period / _STEPS_PER_PERIOD
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            try:
                result = solve_ivp(
                    self._rhs,
                    (0.0, bound),
                    x0,
                    method=solver_class,
                    dense_output=True,
                    events=events,
                    rtol=tolerances.rtol,
                    atol=tolerances.atol,
                    max_step=longest,
                    first_step=first_step,
                    **({"jac": flow.jacobian} if implicit else {}),
                )
            except (
                RuntimeError,
                ValueError,
            ) as failure:  # from its root finder, or a matrix that is not finite
                raise StepFailure(f"solve_ivp raises {type(failure).__name__}: {failure}") from None
        self.failure = result.message if result.status < 0 else ""
        self.steps = iter(self._cut(result, guards, monitors))

    def _rhs(self, s: float, x: np.ndarray) -> np.ndarray:
        self.flow.counters.rhs_evaluations += 1
        if self.flow.look is not None:
            self.flow.look(s)
        return self.flow.rhs(s, x)

    def _guard(self, number: int) -> Callable[[float, np.ndarray], float]:
        def event(s: float, x: np.ndarray) -> float:
            return float(self.flow.guards(np.array([s]), x[None, :])[0, number])

        # SciPy reads these attributes of the function; its type does not declare them
        event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]  # SciPy reads them off the function
        return event

    def _monitor(self, number: int) -> Callable[[float, np.ndarray], float]:
        monitor = self.flow.system.model.monitors[number]

        def event(s: float, x: np.ndarray) -> float:
            return float(self.flow.monitors(np.array([s]), x[None, :])[0, number])

        # as for guards: attributes that the type does not declare
        event.terminal = monitor.action != "record"  # type: ignore[attr-defined]  # SciPy reads them off the function
        event.direction = _DIRECTIONS[monitor.direction]  # type: ignore[attr-defined]  # SciPy reads them off the function
        return event

    def _cut(self, result: Any, guards: list[int], monitors: list[int]) -> list[Step]:
        """Yield the steps of a call of `solve_ivp`, divided at its events."""
        found: dict[float, list[Root]] = {}
        for g, times in zip(guards, result.t_events, strict=False):
            for s in times:
                found.setdefault(float(s), []).append(Root(g, -1))
        for k, times in zip(monitors, result.t_events[len(guards) :], strict=True):
            for s in times:
                found.setdefault(float(s), []).append(Root(k, self._direction(k, result, float(s)), True))
        direction = -1.0 if result.t[-1] < 0.0 else 1.0
        steps: list[Step] = []
        x0 = result.y[:, 0]
        ends = (
            np.unique(np.concatenate([result.t[1:], [s for s in found if s != 0.0]]) * direction) * direction
        )
        s0 = 0.0
        if 0.0 in found:
            if result.status == 1 and result.t[-1] == 0.0:
                raise StepFailure(
                    "solve_ivp stops again at the event from which it restarts, because its sign test includes the "
                    "start of a step, where the event function is zero and does not increase"
                )
            steps.append(Step(0.0, 0.0, x0, x0, dense_of(result.sol), tuple(found[0.0])))
        for s1 in map(float, ends):
            x1 = result.sol(s1)
            steps.append(Step(s0, s1, x0, x1, dense_of(result.sol), tuple(found.get(s1, ()))))
            s0, x0 = s1, x1
        return steps

    def _direction(self, monitor: int, result: Any, s: float) -> int:
        """Return +1 if a monitor rises at a zero, otherwise -1."""
        ends = np.abs(result.t)
        right = int(np.clip(np.searchsorted(ends, abs(s), side="left"), 1, len(ends) - 1))
        pair = result.t[[right - 1, right]]
        before, after = self.flow.monitors(pair, result.sol(pair).T)[:, monitor]
        return 1 if after > before else -1

    def step(self) -> Step:
        """Return the next step of the call of `solve_ivp`."""
        step = next(self.steps, None)
        if step is None:
            raise StepFailure(f"solve_ivp: {self.failure}")
        return step

    def restep(self, step: Step, s: float) -> Step:
        """Raise NotImplementedError; a step of `solve_ivp` already ends at its event."""
        raise NotImplementedError("a step of solve_ivp already ends at its event")
