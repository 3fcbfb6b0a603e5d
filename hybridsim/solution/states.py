"""This module defines the part of a solution that gives times, states and other quantities."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.arguments import as_times, side_of_event
from hybridsim.calls import refusing
from hybridsim.errors import UsageError, nearest

if TYPE_CHECKING:
    from hybridsim.solution.run_trajectory import RunTrajectory


class States:
    """The states of a run over time, as a part of `Solution`."""

    def __init__(self, trajectory: RunTrajectory) -> None:
        self.model, self.integrator = trajectory.model, trajectory.integrator
        self._trajectory, self._grid, self._save = trajectory, trajectory.grid, trajectory.save

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the n states, in the order of the rows of y.

        They follow the order of declaration, then come the states of friction laws. For a `MechanicalSystem`
        they are the positions, then the velocities.
        """
        return self._trajectory.names

    @cached_property
    def t(self) -> np.ndarray:
        """Times (m,): the requested times, or the step times, in which every event time occurs twice."""
        if self._grid is None:
            return self._trajectory.own_times
        if not self._trajectory.has_states:
            return self._grid[:0]
        outside = self._outside(self._grid)
        return self._grid if outside is None else self._grid[~outside]

    @cached_property
    def y(self) -> np.ndarray:
        """States (n, m) at the times t."""
        return self._trajectory.own_states if self._grid is None else self(self.t)

    @property
    def t_start(self) -> float:
        """First time of the run, or of the stored part of the run, in the unit of t."""
        return self._trajectory.t_start

    @property
    def t_end(self) -> float:
        """Last time that the run reached, in the unit of t."""
        return self._trajectory.t_end

    @property
    def x_end(self) -> np.ndarray:
        """States (n,) at the end of the run; they are available for every value of ``keep``."""
        return self._trajectory.x_end

    def __call__(self, t: Any, side: str = "+") -> np.ndarray:
        """Return the states at time t: (n,) for a number, (n, k) for k times.

        With side "+" the result is right-continuous, x+ at an event; "-" gives x-.
        """
        times, side = self._within(as_times(t), side)
        x = self._trajectory.states(times, side)
        return x[0] if np.ndim(t) == 0 else x.T

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of the quantities that `output` returns in addition to the states.

        For a model: outputs, inputs and definitions, discrete states, and relative velocities ``v_rel(f)``. For a
        `MechanicalSystem`: the forces by the names of contacts and impacts, ``v_rel(f)``, and with ``moreau`` the
        gaps ``gap(p)`` of impacts.
        """
        return self._trajectory.quantities

    @refusing
    def output(self, name: str, t: Any = None, side: str = "+") -> np.ndarray:
        """Return a quantity over time: a state, output, input, definition, or variable of a mode.

        ``v_rel(f)`` is the relative velocity of a contact f. A `MechanicalSystem` has the force
        of each contact and impact by its name; with ``moreau`` it is the mean over a step. ``gap(p)`` is the
        gap of one of its impacts.

        Parameters
        ----------
        name : the name of the quantity; see `names` and `quantities`.
        t : a number or an array of times; without it ``sol.t``, with both sides of each event time.

        Returns
        -------
        array
            A number for a number, otherwise (k,), in the unit of the quantity.
        """
        known = (*self.names, *self.quantities)
        if not isinstance(name, str) or name not in known:
            raise UsageError(
                f"model {self.model.name} has no quantity {name!r}",
                remedy=nearest(str(name), known, kind="quantities"),
            )
        if t is None and self._grid is None:
            return self._trajectory.own_values(name)
        requested = self.t if t is None else t
        values = self._trajectory.values(name, *self._within(as_times(requested), side))
        return values[0] if np.ndim(requested) == 0 else values

    def __getitem__(self, name: str) -> np.ndarray:
        """Return a quantity by name at the times t, (m,), as `output` does; ``sol["t"]`` are the times.

        An unknown name raises `UsageError`, with similar names.
        """
        return self.t if name == "t" else self.output(name)

    def __contains__(self, name: object) -> bool:
        """Return whether ``sol[name]`` exists."""
        return name == "t" or name in self.names or name in self.quantities

    def _outside(self, times: np.ndarray) -> np.ndarray | None:
        """Return a mask of the times that are NaN or outside the stored run, or None if there are none."""
        low, high = self.t_start, self.t_end
        if high < low:
            low, high = high, low
        if not len(times) or (times.min() >= low and times.max() <= high):
            return None
        return ~((times >= low) & (times <= high))

    def _within(self, times: np.ndarray, side: str) -> tuple[np.ndarray, str]:
        """Return the times and the side after checking that the run stored the states at these times."""
        side = side_of_event(side)
        if not self._trajectory.has_states:
            raise UsageError(
                f"the run has no trajectory ({self._trajectory.status}: {self._trajectory.message})"
            )
        if self._save in ("events", "nothing"):
            raise UsageError(
                f"the run was made with keep={self._save!r}, which keeps no states between start and end",
                remedy="repeat the run with keep='all', or store the end of the run with keep='last-period'",
            )
        if (outside := self._outside(times)) is not None:
            bad, (low, high) = times[outside][0], sorted((self.t_start, self.t_end))
            stored_part = (
                "the run" if self._save == "all" else f"the part of the run that keep={self._save!r} stores"
            )
            raise UsageError(
                f"t = {float(bad)!r} is outside {stored_part}, which covers t = {low!r} to {high!r}",
                remedy="use times that the run covers",
            )
        return times, side
