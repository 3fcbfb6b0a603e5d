"""The interface between the mode loop and integrators: an integrator gets a flow and returns steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from hybridsim.engine.native.model_functions import evaluate
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.segments import Dense
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tolerances import Tolerances

if TYPE_CHECKING:
    from hybridsim.engine.run.compiled_loop import CompiledLoop


@dataclass(frozen=True)
class Root:
    """A zero located by the integrator itself."""

    number: int  # of the guard or monitor
    direction: int  # -1 falling, 1 rising
    is_monitor: bool = False


@dataclass(frozen=True)
class Step:
    """One accepted step with its dense output."""

    s0: float  # local time at the start
    s1: float  # local time at the end
    x0: np.ndarray  # states (n,) at the start
    x1: np.ndarray  # states (n,) at the end
    dense: Dense  # local times (k,) -> states (k, n)
    roots: tuple[Root, ...] | None = (
        None  # zeros at s1 found by the integrator; None if the mode loop searches
    )
    holds: Callable[[float], bool] | None = (
        None  # whether the dense output is accurate at a time inside the step
    )


@dataclass(frozen=True)
class Watch:
    """The active guards and all monitors of one segment, with their signs and orders of zeros at the start."""

    guards: np.ndarray  # numbers of the active guards
    sides: np.ndarray  # sides (G,) of all guards
    orders: np.ndarray  # leading orders (G,)
    monitor_sides: np.ndarray  # sides (M,) of all monitors
    monitor_orders: np.ndarray  # leading orders (M,)
    x_error: np.ndarray  # error bounds (n,) of the states at the start
    guard_floors: np.ndarray  # resulting error bounds (G,) of guards that start from zero
    monitor_floors: np.ndarray  # the same (M,) for monitors


@dataclass
class Flow:
    """The smooth vector field of one segment, for integrators: `rhs(s, x)` and counts of evaluations.

    look: called with the local time by a method that integrates a whole segment in one call. It raises an error if the
    run has to end.
    """

    system: System
    p: np.ndarray
    z: np.ndarray
    counters: Counters
    forward: bool = True
    look: Callable[[float], None] | None = None

    def __post_init__(self) -> None:
        system = self.system
        self.n = system.n
        self._flow = system.address("flow")
        holding = (c for c in system.projected if self.z[c] == system.automata[c].hold)
        self._projected = sorted({i for c in holding for i in system.projected[c]})

    def rhs(self, s: float, x: np.ndarray) -> np.ndarray:
        """Return dx/dt in a new array, with NaN if the rates are undefined at this point."""
        out = np.empty(self.n)
        evaluate(self._flow, float(s), x, self.p, self.z, out)
        return out

    def jacobian(self, s: float, x: np.ndarray) -> np.ndarray:
        """Return the Jacobian (n, n) of the rates: exact for expressions, else by differences."""
        if not self.system.has_tape:
            return self.system.jacobian(float(s), np.ascontiguousarray(x, dtype=float), self.p, self.z)
        tangent = self.system.address("tangent")
        columns, both = np.empty((self.n, self.n)), np.zeros(2 * self.n)
        both[: self.n] = x
        for k in range(self.n):
            both[self.n :] = 0.0
            both[self.n + k] = 1.0
            evaluate(tangent, float(s), both, self.p, self.z, columns[k])
        return columns.T

    def project(self, s: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return states (k, n) at local times (k,), with held states computed from their constraints."""
        if not self.system.can_hold:
            return np.ascontiguousarray(x, dtype=float)
        return self._rows("project", self.n, s, x)

    def landed(self, s: float, x: np.ndarray) -> np.ndarray:
        """Return the end of a step, moved back onto the surfaces on which projection keeps the states."""
        if not self._projected:
            return x
        held = x.copy()
        held[self._projected] = self.project(np.array([s]), x[None, :])[0, self._projected]
        return held

    def guards(self, s: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return guard values (k, guards) at times and states, with held states on their constraints."""
        self.counters.guard_evaluations += len(s)
        return self._rows("guards", self.system.guard_count, s, x)

    def monitors(self, s: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return monitor values (k, monitors) at times and states, with held states on their constraints."""
        return self._rows("monitors", len(self.system.monitor_names), s, x)

    def _rows(self, name: str, count: int, s: np.ndarray, x: np.ndarray) -> np.ndarray:
        return self.system.rows(name, count, s, np.ascontiguousarray(x, dtype=float), self.p, self.z)


class Stepper(Protocol):
    """An integration in progress through one smooth segment."""

    def step(self) -> Step:
        """Take the next accepted step and return it; raises StepFailure."""

    def restep(self, step: Step, s: float) -> Step:
        """Repeat a step from its start to exactly the local time s, with the accuracy of the method.

        If the error there exceeds the tolerance, return a shorter step, from whose end the next one continues.
        """


class Still:
    """The stepper of a model without continuous states: one step to the end of the segment."""

    def __init__(self, bound: float) -> None:
        self.bound = bound

    def step(self) -> Step:
        """Return the whole segment as one step."""
        return Step(0.0, self.bound, np.zeros(0), np.zeros(0), lambda s: np.zeros((len(s), 0)))

    def restep(self, step: Step, s: float) -> Step:
        """Return the step, shortened to the local time s."""
        return Step(step.s0, s, step.x0, step.x1, step.dense)


class Method(Protocol):
    """The part of an integrator that the mode loop uses."""

    @property
    def name(self) -> str:
        """Return the name of the integrator."""

    @property
    def lacks(self) -> Mapping[str, str]:
        """Return the missing capabilities with reasons; "adaptive" is missing for a fixed step without rtol."""

    @property
    def dense_is_accurate(self) -> bool:
        """Return whether the dense output is as accurate as the method."""

    @property
    def has_compiled_loop(self) -> bool:
        """Return whether the method has a compiled event loop."""

    @property
    def stable_to(self) -> float:
        """Return the limit of -h*lambda for stable steps on the negative real axis, or 0 for no limit."""

    @property
    def rounding(self) -> float:
        """Return the largest rounding error of a step, relative to the rounding of the state change."""

    def compiled_loop(self, system: System, tolerances: Tolerances, longest: float) -> CompiledLoop | None:
        """Return the compiled loop of this method for one run, or None if the method cannot compile the model."""

    def start(
        self,
        flow: Flow,
        x0: np.ndarray,
        s_bound: float,
        tolerances: Tolerances,
        first_step: float | None,
        watch: Watch,
    ) -> Stepper:
        """Begin a segment at local time 0 towards `s_bound`, which is negative for a run backward in time."""
