"""This module defines a prepared run: the model, the integrator, the task and the form of the solution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hybridsim.engine.record.trajectory import Task
from hybridsim.engine.system.system import System
from hybridsim.integrators.contract import Integrator
from hybridsim.model import Model


@dataclass(eq=False)
class Run:
    """A prepared run, which `hybridsim.simulate` makes from its arguments; it never changes.

    Parameters
    ----------
    grid : the times at which the solution is given; None for the integrator's own steps.
    save : the requested retention, as in `simulate`.
    reason : why "auto" chose this method.
    """

    model: Model
    system: System
    method: Integrator
    task: Task
    grid: np.ndarray | None = None
    save: str | float = "all"
    reason: str = ""

    def on_grid(self, grid: np.ndarray | None) -> Run:
        """Return the same run with a solution at other output times."""
        if grid is self.grid:
            return self
        return Run(self.model, self.system, self.method, self.task, grid, self.save, self.reason)
