"""This module runs a mechanical system by time stepping: it prepares arrays, calls kernels and collects results."""

from __future__ import annotations

import math
from collections.abc import Callable
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.engine.native.compiler import seconds_compiling
from hybridsim.engine.native.simd.vectors import WIDTH, padded_rows
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.limits import UNLIMITED, LimitMonitor, LimitReached, Limits
from hybridsim.engine.series.bounded import UNIT
from hybridsim.errors import UsageError
from hybridsim.mechanics.series_loop.mechanical_arrays import rates_of
from hybridsim.mechanics.time_stepping.arrays import build_stepped, directions
from hybridsim.mechanics.time_stepping.kernels import (
    ABOVE,
    HOLDS,
    SteppedRecord,
    SteppedScratch,
    SteppedState,
    steps,
)

if TYPE_CHECKING:
    from hybridsim.integrators.fixed_step.moreau import Moreau
    from hybridsim.mechanics.declaration.system import MechanicalSystem

_STATE_DOUBLES = 1 << 21  # doubles for the states of one call
_EVENTS = 4096  # events per call, in addition to those of one step
_EQUAL = 1e-9  # tolerance for a span that is a whole number of steps


class SteppedRun:
    """One run by time stepping, which the method `go` carries out.

    The span is divided into equal steps, none longer than requested, so that one factored matrix serves all.
    """

    def __init__(
        self,
        system: MechanicalSystem,
        method: Moreau,
        span: tuple[float, float],
        x: np.ndarray,
        is_recorded: bool,
        limits: Limits = UNLIMITED,
    ) -> None:
        self.system, self.span, self.is_recorded, self.start = system, span, is_recorded, x
        self.count = max(math.ceil((span[1] - span[0]) / _length(system, method) * (1.0 - _EQUAL)), 1)
        self.step, self.theta = (span[1] - span[0]) / self.count, method.theta
        self.settings = (self.step, method.theta, method.tolerance, method.iterations)
        self.arrays, self.laws = build_stepped(system, self.step, method.theta)
        n, nc = system.n, len(system.contacts)
        m = nc + len(system.impacts)
        self.state = _new_state(n, m)
        self.scratch = _new_scratch(n, nc, m, int(self.laws.registers.max(initial=0)))
        self.state.q[:], self.state.v[:] = x[:n], x[n:]
        self.states: list[np.ndarray] = [x[None, :]]
        self.forces: list[np.ndarray] = []
        self.events: list[np.ndarray] = []
        self.first_modes = np.zeros(m, dtype=np.int64)
        self.status, self.done, self.kernel_time, self.compile_time = "finished", 0, 0.0, 0.0
        self.overlaps: list[str] = []
        self.limits, self.counters, self.limit_message = limits, Counters(), ""

    def go(self, progress: Callable[[float], None] | None) -> None:
        """Step to the end of the span, or until a state is NaN."""
        self._begin()
        if self.overlaps:
            self.status = "inconsistent"
            return
        system, state = self.system, self.state
        packs = [packed(a) for a in (self.arrays, self.laws, state, self.scratch)]
        began, compiled, m = perf_counter(), seconds_compiling(), len(state.mode)
        rows = max(_STATE_DOUBLES // (2 * system.n + m), 16)
        limit_monitor = LimitMonitor(self.limits, self.counters)
        while self.done < self.count:
            rows_now = min(rows, self.count - self.done)
            record = SteppedRecord(
                np.empty((rows_now if self.is_recorded else 0, 2 * system.n)),
                np.empty((rows_now if self.is_recorded else 0, m)),
                np.empty((_EVENTS + m, 4), dtype=np.int64),
                np.zeros(2, dtype=np.int64),
            )
            done = steps(*packs, packed(record), self.settings, self.span[0], self.done, rows_now)
            self.done += done
            self.states.append(record.states[: record.used[0]])
            self.forces.append(record.forces[: record.used[0]])
            self.events.append(record.event[: record.used[1]].copy())
            if not (np.isfinite(state.q).all() and np.isfinite(state.v).all()):
                self.status = "step-failure"
                break
            if progress is not None:
                progress(self.done / self.count)
            self.counters.steps, self.counters.events = self.done, self.counters.events + int(record.used[1])
            if self.done < self.count:
                try:
                    limit_monitor.check()
                except LimitReached as reached:
                    self.status, self.limit_message = "limit", str(reached)
                    break
        self.compile_time = seconds_compiling() - compiled
        self.kernel_time = perf_counter() - began - self.compile_time

    def _begin(self) -> None:
        """Find the modes at the start from the velocities, and the gaps that are negative at the start."""
        system, arrays, n = self.system, self.arrays, self.system.n
        W, nc, x = directions(system), len(system.contacts), self.start
        turns = arrays.rates * self.span[0]
        angle = turns[arrays.base_rate] if len(arrays.rates) else np.zeros(nc)
        base = arrays.base[:, 0] + arrays.base[:, 1] * np.sin(angle) + arrays.base[:, 2] * np.cos(angle)
        mode = self.state.mode
        mode[:nc] = np.sign((W @ x[n:])[:nc] - base)
        mode[nc:] = ABOVE
        gaps = (W @ x[:n])[nc:] + arrays.gap
        sizes = (abs(W) @ np.abs(x[:n]))[nc:] + np.abs(arrays.gap)
        self.overlaps = [
            i.name for i, g, s in zip(system.impacts, gaps, sizes, strict=True) if g < -8 * UNIT * s
        ]
        self.first_modes = mode.copy()

    @property
    def time(self) -> float:
        """The time that the run has reached."""
        return self.span[1] if self.done == self.count else self.span[0] + self.done * self.step


def _length(system: MechanicalSystem, method: Moreau) -> float:
    """Return the given step size, or else a fraction of the forcing period."""
    for label in ("step", "period", "steps_per_period"):
        value = getattr(method, label)
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise UsageError(f"moreau: `{label}` cannot be {value!r}", remedy="use a positive number")
    if method.step is not None:
        return method.step
    rates = [abs(rate) for rate in rates_of(system) if rate != 0.0]
    period = method.period or (2.0 * math.pi / rates[0] if len(set(rates)) == 1 else None)
    if period is None:
        raise UsageError(
            f"moreau needs a step size, because {system.name} has no single forcing period",
            remedy="use step=... or period=...",
        )
    return period / method.steps_per_period


def _new_state(n: int, m: int) -> SteppedState:
    return SteppedState(
        np.zeros(n), np.zeros(n), np.full(m, HOLDS, dtype=np.int64), np.zeros(m), np.zeros(5),
        np.zeros(4, dtype=np.int64), np.zeros(1),
    )  # fmt: skip


def _new_scratch(n: int, nc: int, m: int, registers: int) -> SteppedScratch:
    of: dict[str, Any] = {name: np.zeros(n) for name in ("force", "force_after", "b", "free", "solved")}
    of |= {name: np.zeros(m) for name in ("y", "u", "rebound")}
    of |= {name: np.zeros(nc) for name in ("speed", "up", "down", "up_before", "down_before")}
    of |= {name: np.zeros(m, dtype=np.int64) for name in ("active", "dirty", "next")}
    width = nc + WIDTH  # in whole vectors
    return SteppedScratch(
        **of,
        base=np.zeros((nc, 3)),
        lane=np.zeros(width, dtype=np.int64),
        V=padded_rows(1, registers * width + 1)[0],
    )
