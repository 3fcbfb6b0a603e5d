"""This module defines a point between two steps of a run, from which compiled code takes the next step.

A step without events is one call of the compiled loop. The general loop takes a step in which something else happens;
it continues from the same call.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property

import numpy as np

from hybridsim.engine.events.compiled.input_change import changed_inputs
from hybridsim.engine.events.outcome import Outcome
from hybridsim.engine.events.state import HybridState
from hybridsim.engine.events.zeno.accumulation import Accumulation
from hybridsim.engine.record.checkpoint import Checkpoint
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.trajectory import Task
from hybridsim.engine.run.compiled_loop import CompiledLoop
from hybridsim.engine.run.method_kernels import STEPS_PER_LOOK, MethodKernels
from hybridsim.engine.run.setup import RunSetup
from hybridsim.engine.system.failures import StepFailure
from hybridsim.engine.system.instant import Instant

_Now = tuple[Instant, HybridState, tuple[int, int], MethodKernels]


class ResumePoint:
    """A point between two steps of a run, from which the next step starts; the object never changes.

    Parameters
    ----------
    setup, task : of the run.
    checkpoint : the checkpoint at this point, or at an earlier one if `now` has what changed since.
    counters : the work up to this point.
    now : the instant, the state, the used rows of the loop's record, and the part of the method.
    """

    def __init__(
        self, setup: RunSetup, task: Task, checkpoint: Checkpoint, counters: Counters, now: _Now | None = None
    ) -> None:
        self.setup, self.task, self.counters, self._before = setup, task, counters, checkpoint
        self.instant, self._now = checkpoint.instant if now is None else now[0], now

    @property
    def x(self) -> np.ndarray:
        """Return the states (n,)."""
        return self._before.arrays["x"] if self._now is None else self._now[1].x

    @property
    def z(self) -> np.ndarray:
        """Return the modes (C,)."""
        return self._before.arrays["z"] if self._now is None else self._now[1].z

    @property
    def discrete(self) -> np.ndarray:
        """Return the discrete states and held inputs, which methods with fixed steps store separately."""
        arrays, system = self._before.arrays, self.setup.system
        if self._now is not None:
            return system.discrete(self._now[1].p)
        return system.discrete(arrays["p"]) if "p" in arrays else arrays["discrete"]

    @cached_property
    def checkpoint(self) -> Checkpoint:
        """Return the checkpoint at this point."""
        if self._now is None:
            return self._before
        instant, state, _, _ = self._now
        arrays = self._before.arrays | state.copy().outcome().arrays()
        arrays |= {"step_size": np.array(math.nan), "place": np.concatenate(self.loop().place)}
        return replace(self._before, instant=instant, arrays=arrays, settled=instant)

    @property
    def now(self) -> _Now | None:
        """Return the state for a compiled loop, or None if the general loop has to continue from this point."""
        return self._now or self._of_checkpoint

    @cached_property
    def _of_checkpoint(self) -> _Now | None:
        checkpoint, loop, system = self._before, self.setup.compiled_loop(), self.setup.system
        arrays = checkpoint.arrays
        is_general = (
            system.model.schedules or system.signals or system.monitor_names or "taken_over" in arrays
        )
        if loop is None or is_general or self.task.retention.segments is not None:
            return None
        accumulation = Accumulation()
        accumulation.go_on(checkpoint.paces)
        if accumulation.is_under_way(float(checkpoint.instant)):
            return None
        if "place" in arrays:
            loop.place = arrays["place"]
        outcome = Outcome.of_arrays(arrays)
        return checkpoint.instant, HybridState.of(outcome, outcome.p), loop.used, loop.kernels

    def loop(self) -> CompiledLoop:
        """Return a compiled loop that continues from this point."""
        assert self.now is not None
        try:
            loop = self.setup.idle_loops.pop()
        except IndexError:
            found = self.setup.compiled_loop()
            assert found is not None
            loop = found
        _, _, loop.used, kernels = self.now
        loop.kernels = kernels.fresh_copy()
        return loop

    def step(self, end: Instant) -> ResumePoint | CompiledLoop | None:
        """Return the point at the end of a step without events.

        Otherwise return the compiled loop with the call that has begun the step, for the general loop, or None if that
        loop has to begin.
        """
        if self.now is None:
            return None
        origin, state, _, _ = self.now
        loop = self.loop()
        try:
            run = loop.go(origin, state, end)
        except StepFailure:  # the general loop says why
            return None
        if run is None:
            return None
        counters = self.counters.copy()
        loop.count(run, counters)
        is_looked_at = self.setup.method.stable_to and (  # for stiffness
            self.counters.steps // STEPS_PER_LOOK < counters.steps // STEPS_PER_LOOK
        )
        if not run.is_at_target or run.lacks_tapes or run.events or not run.count or is_looked_at:
            loop.kernel_run = run
            return loop
        used, kernels = (run.first_step + run.steps, run.first + run.count + 1), loop.kernels
        if not kernels.is_continued:
            kernels.take(run.result)
            used = (0, 0)
        run.end.divide()
        self.setup.idle_loops.append(loop)
        return ResumePoint(self.setup, self.task, self._before, counters, (end, run.end, used, kernels))

    def changed(self, discrete: np.ndarray) -> ResumePoint | None:
        """Return the point after a change of discrete states, or None if this change may change a mode."""
        if self.now is None:
            return None
        instant, state, used, kernels = self.now
        found = changed_inputs(self.setup.system, instant, state, discrete)
        if found is None:
            return None
        return ResumePoint(
            self.setup, self.task, self._before, self.counters, (instant, found, used, kernels)
        )
