"""This module defines the common parts of the results of mechanical systems: names, tables, and missing features."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Any, NoReturn, Self

import numpy as np

from hybridsim.arguments import as_times, known_name, text
from hybridsim.errors import UsageError
from hybridsim.presentation.tables import Table
from hybridsim.solution.files.in_tables import InTables
from hybridsim.solution.solution import Solution

if TYPE_CHECKING:
    from hybridsim.mechanics.declaration.system import MechanicalSystem
    from hybridsim.solution import ModeInterval

_ALONE = "simulate system.to_model(), whose Solution has it (if the contact velocities are independent)"
_INSTEAD = {
    "save": "to_npz() writes its table and events; to save all of it, simulate system.to_model()",
    "resume": "start a new run from x0=sol.x_end, or simulate system.to_model()",
    "corners": "a MechanicalSystem has no laws with corners",
}


class ArraysResult(InTables):
    """The base class of the results of mechanical systems."""

    model: MechanicalSystem
    integrator: str
    _save: str

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the states, in the order of the rows of y."""
        return (*self.model.names, *self.model.velocities)

    @property
    def sol(self) -> Self:
        """The dense output, under SciPy's name."""
        return self

    @property
    @abstractmethod
    def t(self) -> np.ndarray:
        """Times (k,)."""

    @property
    @abstractmethod
    def t_start(self) -> float:
        """First time of the run."""

    @property
    @abstractmethod
    def t_end(self) -> float:
        """Last time that the run reached."""

    @property
    @abstractmethod
    def status(self) -> str:
        """How the run ended."""

    @property
    @abstractmethod
    def modes(self) -> dict[str, tuple[ModeInterval, ...]]:
        """The modes of each component in order, with the time interval of each."""

    @property
    @abstractmethod
    def quantities(self) -> tuple[str, ...]:
        """Names of the quantities of `output` in addition to the states."""

    @abstractmethod
    def _values(self, name: str, t: np.ndarray, right: bool) -> np.ndarray:
        """Return a quantity just after some times, or just before these times."""

    def table(self, points: int | None = None) -> Table:
        """Return times, states, forces, relative velocities and modes as columns.

        Parameters
        ----------
        points : the number of equally spaced times, both ends included; without it ``sol.t``, with both sides
        of each event time, or the grid of `simulate`.
        """
        from hybridsim.solution.files.tabulated import equal_steps

        t = self.t if points is None else equal_steps(self.t_start, self.t_end, points)
        before = np.append(np.diff(t) == 0.0, False)[: len(t)]  # the first of two equal times
        columns = {}
        for name in (*self.names, *self.quantities):
            columns[name] = self._values(name, t, True)
            if before.any():
                columns[name][before] = self._values(name, t[before], False)
        modes = {}
        for component, intervals in self.modes.items():
            begins = [interval.t0 for interval in intervals]
            place = np.where(before, np.searchsorted(begins, t), np.searchsorted(begins, t, side="right")) - 1
            known = tuple(dict.fromkeys(interval.mode for interval in intervals))
            numbers = np.array([known.index(interval.mode) for interval in intervals], dtype=np.int64)
            modes[component] = (known, numbers[np.maximum(place, 0)])
        about = {"model": self.model.name, "title": "", "integrator": self.integrator, "status": self.status}
        return Table(t, columns, modes, {}, about)

    def _within(self, t: Any) -> np.ndarray:
        """Return times (k,) from a number or an array, after checking that they lie in the run."""
        times = as_times(t)
        inside = (times >= self.t_start) & (times <= self.t_end)
        if not inside.all():
            bad = float(times[~inside][0])
            raise UsageError(
                f"t = {bad!r} is outside of the run, which covers t = {self.t_start!r} to {self.t_end!r}",
                remedy="use times within the run",
            )
        return times

    def _asked(self, component: Any, kind: Any, names: list[str]) -> None:
        """Refuse an unknown component, or a kind that is not a string."""
        self._require_events()
        known_name(component, names, f"{self.model.name} has no component", "components")
        if kind is not None:
            text(kind, "kind")

    def _require_states(self) -> None:
        if self._save != "all":
            raise UsageError(
                f"the run was made with save={self._save!r}, which stores no states between start and end",
                remedy="run the simulation with save='all'",
            )

    def _require_events(self) -> None:
        if self._save == "nothing":
            raise UsageError(
                "the run was made with save='nothing', which stores no events",
                remedy="run the simulation with save='events'",
            )

    def __getattr__(self, name: str) -> NoReturn:
        """Raise an AttributeError with an alternative for a feature that only `Solution` has."""
        kind = type(self).__name__
        if name.startswith("_") or not hasattr(Solution, name):
            raise AttributeError(f"{kind} has no {name!r}", name=name, obj=self)
        raise AttributeError(f"a {kind} has no {name}: {_INSTEAD.get(name, _ALONE)}", name=name, obj=self)
