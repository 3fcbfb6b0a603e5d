"""This module binds the kernels of the published methods to one run."""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType
from typing import cast

import numpy as np

from hybridsim.engine.native.kernels import ENABLED, Precompiled
from hybridsim.engine.native.model_functions import evaluate
from hybridsim.engine.system.system import System
from hybridsim.integrators.fixed_step.march import March
from hybridsim.integrators.fixed_step.rk4_kernels import run_steps, workspace
from hybridsim.integrators.fixed_step.run import ROWS
from hybridsim.integrators.fixed_step.step_code import SIGN, ZONE, StepCode, step_functions
from hybridsim.integrators.fixed_step.surface_table import surface_table

_run_steps = Precompiled(run_steps)


@dataclass(frozen=True)
class FixedStep:
    """The settings that both published methods pass to the kernel."""

    step: float
    rule: int
    every_stage: bool
    zeroed: bool
    located: bool
    rest_of_step: bool
    eps: float
    halvings: int


class Rk4March(March):
    """The kernels of a published method for one run."""

    def __init__(self, system: System, settings: FixedStep) -> None:
        self.step, self.halvings, self.pinned = settings.step, settings.halvings, settings.zeroed
        self.has_sides_only = settings.rule == SIGN
        self.counts = np.zeros(3, dtype=np.int64)
        self._table = surface_table(system)
        rows = tuple(tuple(row) for row in self._table.tolist())
        sizes = (system.n, len(system.automata), system.guard_count, rows)
        code = StepCode(*sizes, settings.rule, settings.every_stage, settings.zeroed, system.layout.pin_at)
        # the addresses are valid as long as this object exists: the cache may give it up during a run
        functions, self._functions_in_memory = step_functions(cast(ModuleType, system.code.module), code)
        self._addresses = (
            *functions,
            *(system.address(name) for name in ("guards", "monitors", "project", "surfaces")),
        )
        self._settings = (float(settings.step), settings.halvings, float(settings.eps))
        has_march = ENABLED and not settings.located and not system.monitor_names
        self._flags = (
            settings.rule == ZONE,
            settings.zeroed,
            settings.located,
            settings.rest_of_step,
            has_march,
        )
        self._work = workspace(system, len(self._table), ROWS)

    def run(
        self,
        guard_numbers: np.ndarray,
        bound: float,
        p: np.ndarray,
        start: tuple[np.ndarray, np.ndarray],
        fresh: np.ndarray,
        rows: tuple[np.ndarray, np.ndarray, np.ndarray],
    ) -> tuple[int, int]:
        """Take steps up to the bound, or until an event needs the Python code."""
        x, z = start
        rows[1][0] = x
        count, why = _run_steps(
            self._addresses, self._settings, self._flags, self._table, guard_numbers, bound, p, z, fresh, *rows,
            self._work, self.counts,
        )  # fmt: skip
        return count, why

    def trial(self, s: float, tau: float, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return the state after one step of length `tau`."""
        out = self._work[1]
        out[-2:] = tau, self._settings[2]
        evaluate(self._addresses[1], s, x, p, z, out)
        self.counts[0] += 4
        return out[: len(x)].copy()
