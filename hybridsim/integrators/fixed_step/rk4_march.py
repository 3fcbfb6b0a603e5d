"""The kernels of the published methods, bound to one run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hybridsim.engine.system.system import System
from hybridsim.integrators.fixed_step.rk4_kernels import SIGN, rk4_step, run_steps, workspace
from hybridsim.integrators.fixed_step.run import surface_table


@dataclass(frozen=True)
class FixedStep:
    """Settings that both methods pass to the kernel."""

    step: float
    rule: int
    every_stage: bool
    dichotomy: bool
    zeroed: bool
    located: bool
    rest_of_step: bool
    eps: float
    halvings: int


class Rk4March:
    """The kernels of one run; see `hybridsim.integrators.fixed_step.run.March`."""

    def __init__(self, system: System, settings: FixedStep) -> None:
        self.step, self.halvings, self.pinned = settings.step, settings.halvings, settings.zeroed
        self.has_sides_only = settings.rule == SIGN
        self.counts = np.zeros(3, dtype=np.int64)
        self._table = surface_table(system)
        names = ("flow", "surfaces", "guards", "monitors", "project")
        self._addresses = tuple(system.address(n) for n in names)
        self._law = (settings.rule, settings.every_stage, settings.eps)
        self._flags = (settings.dichotomy, settings.zeroed, settings.located, settings.rest_of_step)
        monitors = len(system.monitor_names)
        self._work = workspace(system.n, len(system.automata), len(self._table), system.guard_count, monitors)

    def run(
        self,
        guard_numbers: np.ndarray,
        bound: float,
        p: np.ndarray,
        start: tuple[np.ndarray, np.ndarray],
        fresh: np.ndarray,
        rows: tuple[np.ndarray, np.ndarray, np.ndarray],
    ) -> tuple[int, int]:
        """Step up to the bound, or until Python has to act."""
        count, why = run_steps(
            self._addresses, (self.step, self.halvings), self._law, self._flags, self._table, guard_numbers, bound, p,
            *start, fresh, *rows, self._work, self.counts,
        )  # fmt: skip
        return count, why

    def trial(self, s: float, tau: float, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return the state after one step of length tau."""
        out = np.empty(len(x))
        rk4_step(self._addresses, self._law, self._table, s, tau, x, p, z, out, self._work)
        self.counts[0] += 4
        return out

    def refused(self) -> str:
        """Return an empty message, because these methods do not support impacts."""
        return ""

    def warnings(self) -> list[str]:
        """Return no warnings: the results show the errors of these methods."""
        return []
