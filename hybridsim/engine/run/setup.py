"""The set-up of a run before its first instant, stored with its task and shared by all runs of the task."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from functools import cached_property

import numpy as np

from hybridsim.engine.events.monitor_corners import corners_of_monitors
from hybridsim.engine.events.outcome import Outcome
from hybridsim.engine.events.start import settled_start, start_by_kernel
from hybridsim.engine.events.state import HybridState
from hybridsim.engine.record.trajectory import Task
from hybridsim.engine.run.compiled_loop import CompiledLoop
from hybridsim.engine.run.stepping import Method
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System

# Number of turns of the fastest angle after which a segment without events is restarted, because rounding then reaches
# 1e-13.
_RENEWAL_TURNS = 100


class LazyState:
    """The state after the last event, and its run-time values; both are computed on demand.

    Parameters
    ----------
    make : makes the outcome.
    shared : outcome and vector stored elsewhere, for reading only.
    """

    def __init__(
        self,
        system: System,
        instant: Instant,
        forward: bool,
        make: Callable[[], Outcome],
        shared: tuple[Outcome, np.ndarray] | None = None,
    ) -> None:
        self._system, self._instant, self._forward = system, instant, forward
        self._make, self._shared = make, shared

    @cached_property
    def outcome(self) -> Outcome:
        """Return the state after the last event."""
        return self._make()

    @cached_property
    def p(self) -> np.ndarray:
        """Return the run-time vector: parameters, inputs and discrete states."""
        return self._system.vector(self._instant, self._system.discrete(self.outcome.p), self._forward)

    def read(self) -> tuple[Outcome, np.ndarray]:
        """Return the state and the run-time values for reading; the caller must not modify them."""
        return self._shared or (self.outcome, self.p)


class RunSetup:
    """The set-up shared by all runs of one task with one method; the task stores it."""

    def __init__(self, system: System, method: Method, task: Task) -> None:
        self.system, self.method = system, method
        self.origin, self.end = Instant(task.t0), Instant(task.t1)
        self.renewal = _RENEWAL_TURNS * 2.0 * math.pi / system.fastest if system.fastest else math.inf
        self._pattern = self._compiled_loop(task)
        self.idle_loops: deque[CompiledLoop] = deque()  # of runs in steps, which reuse their arrays
        self.begins_silently = False  # set by `_at_start`: whether nothing is recorded at the start
        self._start: tuple[Outcome, np.ndarray] | None = None
        self._buffer: HybridState | None = None  # the same in the layout of compiled loops

    def _compiled_loop(self, task: Task) -> CompiledLoop | None:
        """Return the compiled loop if the method and the model allow one, else None."""
        system, model = self.system, self.system.model
        if (
            not self.method.has_compiled_loop
            or not task.forward
            or system.n == 0
            or not all(signal.is_polynomial for signal in system.signals)
        ):
            return None
        if not model.monitors:
            return self.method.compiled_loop(system, task.tolerances, self.renewal)
        corners = corners_of_monitors(system)
        if corners is None:
            return None
        compiled_loop = self.method.compiled_loop(corners.system, task.tolerances, self.renewal)
        if compiled_loop is not None:
            compiled_loop.pass_monitors(corners)
        return compiled_loop

    def compiled_loop(self) -> CompiledLoop | None:
        """Return a compiled loop for one run, or None."""
        return None if self._pattern is None else self._pattern.fresh_copy()

    def silent_start(self, task: Task) -> HybridState | None:
        """Return the read-only state at the start, if the start has no events.

        The result is also None if there are schedules or input signals, or if there is no compiled loop.
        """
        system = self.system
        if self._pattern is None or system.model.schedules or system.signals:
            return None
        if self._buffer is None:
            self._buffer = start_by_kernel(system, task, self.origin)
            self.begins_silently = self._buffer is not None
        if self._buffer is None:
            settled = self._at_start(task, ())
            if self.begins_silently:
                corners = self._pattern.corners
                self._buffer = HybridState.of(*settled) if corners is None else corners.state(*settled)
        return self._buffer

    def start(self, task: Task, due: tuple[int, ...]) -> LazyState:
        """Return the state just after the start of a task, after schedules that are due at the start."""
        settled = self._at_start(task, due)
        return LazyState(self.system, self.origin, task.forward, settled[0].copy, settled)

    def _at_start(self, task: Task, due: tuple[int, ...]) -> tuple[Outcome, np.ndarray]:
        """Return the state and the run-time values at the start."""
        system, forward = self.system, task.forward
        if self._start is None and self._buffer is not None:
            self._start = self._buffer.copy().outcome(), self._buffer.p
        if self._start is None:
            outcome = settled_start(system, task, self.origin, due)
            is_recorded = bool(due or outcome.changes or outcome.warnings or outcome.status)
            self.begins_silently = forward and not is_recorded
            self._start = outcome, system.vector(self.origin, system.discrete(outcome.p), forward)
        return self._start


def setup_of(system: System, method: Method, task: Task) -> RunSetup:
    """Return the set-up stored with a task; create the set-up if there is none."""
    setup = task.setups.get("last")
    if setup is None or setup.system is not system or setup.method is not method:
        setup = task.setups["last"] = RunSetup(system, method, task)
    return setup
