"""What the results of mechanical systems have in common: names, tables, and what they leave to ordinary models."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Any, NoReturn, Self

import numpy as np

from hybridsim.arguments import as_times, known_name, text
from hybridsim.errors import UsageError
from hybridsim.solution.in_tables import InTables
from hybridsim.solution.solution import Solution
from hybridsim.tables import Table

if TYPE_CHECKING:
    from hybridsim.mechanics.system import MechanicalSystem
    from hybridsim.solution import ModeInterval

_ALONE = "run to_model() of the system, whose Solution has it (for contacts whose velocities are independent)"
_INSTEAD = {
    "save": "to_npz() writes its table and events; or run to_model() of the system, whose Solution can be saved",
    "resume": "simulate the rest from x0=sol.x_end, as a run of its own; or run to_model() of the system",
    "corners": "laws with corners are no part of a MechanicalSystem",
}


class ArraysResult(InTables):
    """A run of a system that is given as arrays."""

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
        """For each component its modes in order, with the stretch of time of each."""

    @property
    @abstractmethod
    def quantities(self) -> tuple[str, ...]:
        """Names of what `output` knows beside the states."""

    @abstractmethod
    def _values(self, name: str, t: np.ndarray, right: bool) -> np.ndarray:
        """A quantity just after some times, or just before them."""

    def table(self, points: int | None = None) -> Table:
        """Times, states, forces, relative velocities and modes in columns.

        Parameters
        ----------
        points : how many equal steps of time to take, both ends included; without it ``sol.t``: each event time twice,
            on both its sides, or the grid of `simulate`.
        """
        from hybridsim.solution.tabulated import equal_steps

        t = self.t if points is None else equal_steps(self.t_start, self.t_end, points)
        before = np.append(np.diff(t) == 0.0, False)[: len(t)]  # of a time that stands twice, the first
        columns = {}
        for name in (*self.names, *self.quantities):
            columns[name] = self._values(name, t, True)
            if before.any():
                columns[name][before] = self._values(name, t[before], False)
        modes = {}
        for component, stretches in self.modes.items():
            begins = [stretch.t0 for stretch in stretches]
            place = np.where(before, np.searchsorted(begins, t), np.searchsorted(begins, t, side="right")) - 1
            known = tuple(dict.fromkeys(stretch.mode for stretch in stretches))
            numbers = np.array([known.index(stretch.mode) for stretch in stretches], dtype=np.int64)
            modes[component] = (known, numbers[np.maximum(place, 0)])
        about = {"model": self.model.name, "title": "", "integrator": self.integrator, "status": self.status}
        return Table(t, columns, modes, {}, about)

    def _within(self, t: Any) -> np.ndarray:
        """Times (k,) out of a number or an array of them, all of which lie in the run."""
        times = as_times(t)
        inside = (times >= self.t_start) & (times <= self.t_end)
        if not inside.all():
            bad = float(times[~inside][0])
            raise UsageError(
                f"t = {bad!r} is outside of the run, which goes from {self.t_start!r} to {self.t_end!r}",
                remedy="give times within it",
            )
        return times

    def _asked(self, component: Any, kind: Any, names: list[str]) -> None:
        """Refuse a component that the run does not have, and a kind that is no word."""
        self._require_events()
        known_name(component, names, f"{self.model.name} has no component", "components")
        if kind is not None:
            text(kind, "kind")

    def _require_states(self) -> None:
        if self._save != "all":
            raise UsageError(
                f"the run was made with save={self._save!r}, which keeps no states between the ends",
                remedy="run it with save='all'",
            )

    def _require_events(self) -> None:
        if self._save == "nothing":
            raise UsageError(
                "the run was made with save='nothing', which keeps no events", remedy="save='events'"
            )

    def __getattr__(self, name: str) -> NoReturn:
        """What a `Solution` has and this has not: an AttributeError that says what to do instead."""
        kind = type(self).__name__
        if name.startswith("_") or not hasattr(Solution, name):
            raise AttributeError(f"{kind} has no {name!r}", name=name, obj=self)
        raise AttributeError(f"a {kind} has no {name}: {_INSTEAD.get(name, _ALONE)}", name=name, obj=self)
