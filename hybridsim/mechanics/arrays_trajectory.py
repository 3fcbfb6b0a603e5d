"""This module contains the common parts of the trajectories of mechanical systems."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from hybridsim.errors import UsageError
from hybridsim.mechanics.declaration.system import MechanicalSystem
from hybridsim.presentation.tables import Table
from hybridsim.solution.by_name import ByName
from hybridsim.solution.event import ModeInterval


class ArraysTrajectory(ABC):
    """The base class of a `hybridsim.solution.run_trajectory.RunTrajectory` of a mechanical system.

    Parameters
    ----------
    parts : the contacts, then the impacts, in the order of declaration.
    run : the finished run.
    grid, save : requested times, and what is stored, as in `simulate`.
    cost : seconds of the run and of compiling.
    """

    integrator: str
    reason, corners, has_states = "", (), True
    has_instants = True  # whether a mode may last for an instant only
    work: Any = None

    def __init__(
        self,
        model: MechanicalSystem,
        parts: Sequence[Any],
        run: Any,
        grid: np.ndarray | None,
        save: str,
        cost: tuple[float, float],
    ) -> None:
        self.model, self.components, self.run = model, tuple(parts), run
        self.grid, self.cost = grid, cost
        self.save: str | float = save

    # -- what each kind of run has for itself ---------------------------------------------------------------

    @property
    @abstractmethod
    def t_end(self) -> float:
        """Return the last time that the run reached."""

    @property
    @abstractmethod
    def own_times(self) -> np.ndarray:
        """Return the times (m,) at which the run stored its states."""

    @property
    @abstractmethod
    def quantities(self) -> tuple[str, ...]:
        """Return the names of the quantities other than the states."""

    @property
    @abstractmethod
    def status(self) -> str:
        """Return how the run ended."""

    @abstractmethod
    def states(self, times: np.ndarray, side: str) -> np.ndarray:
        """Return the states (k, 2n) at given times."""

    @abstractmethod
    def values(self, name: str, times: np.ndarray, side: str) -> np.ndarray:
        """Return the values (k,) of a state or another quantity at given times."""

    def friction_powers(self, times: np.ndarray) -> np.ndarray:
        """Return the friction force times the relative velocity (k, contacts) of each contact at times (k,)."""
        forces, velocities = self.forces_and_velocities(times)
        return forces * velocities

    @abstractmethod
    def forces_and_velocities(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return friction forces and relative velocities (k, contacts) at times (k,), after events."""

    @property
    @abstractmethod
    def changes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return times (E,), components (E,) and modes before and after (E, 2) of all changes of mode."""

    @abstractmethod
    def first_mode(self, component: int) -> int:
        """Return the mode of a component at the start."""

    @abstractmethod
    def mode_names(self, component: int) -> dict[int, str]:
        """Return the names of the modes of a component, in the order of the mode numbers."""

    # -- what they have in common ---------------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the positions, followed by the names of the velocities."""
        return (*self.model.names, *self.model.velocities)

    @property
    def event_names(self) -> list[str]:
        """Return the names of the contacts and impacts."""
        return [part.name for part in self.components]

    @property
    def t_start(self) -> float:
        """Return the first time of the run."""
        return float(self.run.span[0])

    def own_values(self, name: str) -> np.ndarray:
        """Return a state or a quantity at the times of the run itself."""
        return self._column(name, self.own_times)

    def _column(self, name: str, times: np.ndarray) -> np.ndarray:
        """Return a quantity at times. If a time occurs twice, the first value is the value before the event."""
        self.require_states()
        before = self._are_before(times)
        values = self.values(name, times, "+")
        if before.any():
            values[before] = self.values(name, times[before], "-")
        return values

    def _are_before(self, times: np.ndarray) -> np.ndarray:
        return np.append(np.diff(times) == 0.0, False)[: len(times)]

    def event_times(self, component: str, kind: str | None) -> np.ndarray:
        """Return the times (m,) of the events of one contact or impact."""
        when, components, _ = self.changes
        return when[(components == self.event_names.index(component)) & (kind in (None, "transition"))]

    def event_states(self, component: str, kind: str | None, side: str) -> np.ndarray:
        """Return the states (m, 2n) at the events of one contact or impact."""
        self.require_states()
        return self.states(self.event_times(component, kind), side)

    @cached_property
    def modes(self) -> dict[str, tuple[ModeInterval, ...]]:
        """Return the modes of each contact and impact over the run, in order."""
        found = ByName[tuple[ModeInterval, ...]]()
        when, components, changes = self.changes
        for k, part in enumerate(self.components):
            mine, names = components == k, self.mode_names(k)
            times = [self.t_start, *when[mine].tolist(), self.t_end]
            numbers = [self.first_mode(k), *changes[mine, 1].tolist()]
            found[part.name] = tuple(
                ModeInterval(names[z], a, b)
                for z, a, b in zip(numbers, times[:-1], times[1:], strict=True)
                if self.has_instants or b > a or len(numbers) == 1
            )
        return found

    def table(self, times: np.ndarray | None) -> Table:
        """Return states, forces, relative velocities and modes over time, as the columns of a table."""
        t = self.own_times if times is None else times
        before = self._are_before(t)
        columns = {name: self._column(name, t) for name in (*self.names, *self.quantities)}
        modes = {}
        for component, intervals in self.modes.items():
            begins = [interval.t0 for interval in intervals]
            place = np.where(before, np.searchsorted(begins, t), np.searchsorted(begins, t, side="right")) - 1
            known = tuple(dict.fromkeys(interval.mode for interval in intervals))
            numbers = np.array([known.index(interval.mode) for interval in intervals], dtype=np.int64)
            modes[component] = (known, numbers[np.maximum(place, 0)])
        about = {"model": self.model.name, "title": "", "integrator": self.integrator, "status": self.status}
        return Table(t, columns, modes, {}, about)

    def require_states(self) -> None:
        """Raise an error if the run stored no states."""
        if self.save != "all":
            raise UsageError(
                f"the run was made with keep={self.save!r}, which keeps no states between start and end",
                remedy="repeat the run with keep='all'",
            )
