"""This module defines the result of a run: times, states, dense output, events, modes, outputs and cost."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.arguments import as_times, side_of_event, text
from hybridsim.calls import refusing
from hybridsim.errors import UsageError, nearest
from hybridsim.presentation.tables import Table
from hybridsim.solution.event import Event, ModeInterval
from hybridsim.solution.files.in_tables import InTables
from hybridsim.solution.files.tabulated import equal_steps
from hybridsim.solution.model_trajectory import ModelTrajectory, relative_velocity
from hybridsim.solution.summary import as_text, in_html

if TYPE_CHECKING:
    from hybridsim.engine.record.block_list import SegmentBlockList
    from hybridsim.engine.system.system import System
    from hybridsim.solution.explain.explanation import Explanation
    from hybridsim.solution.run import Run
    from hybridsim.solution.run_trajectory import RunTrajectory

_GOOD = ("finished", "terminated")


class Solution(InTables):
    """The result of `simulate` for every model and integrator; ``sol(t)`` is the dense output.

    Attributes
    ----------
    model : Model or MechanicalSystem
        What was simulated.
    integrator : str
        Name of the integrator.
    t : array
        Times (m,), in the unit of t of the model: ``t_eval`` as far as the run came, otherwise the steps, with
        every event time twice. For a `MechanicalSystem` with ``moreau`` they are the ends of the steps.
    y : array
        States (n, m) at the times t, as in SciPy: one row per state, in the unit of the state, and one column
        per time, with x- and x+ at the two entries of an event time. The rows follow ``names``.

    Other Parameters
    ----------------
    trajectory : object
        Passed on by `simulate`; do not construct a solution by hand.

    Examples
    --------
    >>> import hybridsim as hs
    >>> sol = hs.simulate("dfcs", (0, 0.1))
    >>> sol(0.05).shape, len(sol.events)
    ((2,), 27)
    >>> sol.names
    ('x', 'v')
    >>> hs.simulate(hs.two_blocks_on_belt(), (0, 1)).names
    ('q1', 'q2', 'v1', 'v2')
    """

    def __init__(self, trajectory: RunTrajectory) -> None:
        self.model, self.integrator = trajectory.model, trajectory.integrator
        self._trajectory, self._grid, self._save = trajectory, trajectory.grid, trajectory.save

    # -- the run of a `Model`, for other parts of the package -------------------------------------------------

    @property
    def _of_model(self) -> ModelTrajectory:
        """Return the trajectory if a `Model` was simulated, and refuse otherwise."""
        if not isinstance(self._trajectory, ModelTrajectory):
            raise UsageError(
                f"{self.model.name} is a MechanicalSystem, whose runs cannot be saved, resumed, explained or "
                "differentiated",
                remedy="simulate system.to_model() (if the contact velocities are independent); to_npz() writes the "
                "table and the events, and a new run can start from x0=sol.x_end",
            )
        return self._trajectory

    @property
    def _run(self) -> Run:
        return self._of_model.run

    @property
    def _system(self) -> System:
        return self._of_model.system

    @property
    def _segments(self) -> SegmentBlockList:
        return self._of_model.segments

    # -- trajectory -----------------------------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the n states, in the order of the rows of y.

        They follow the order of declaration, then come the states of friction laws. For a `MechanicalSystem`
        they are the positions, then the velocities.
        """
        return self._trajectory.names

    @cached_property
    def t(self) -> np.ndarray:
        """Times (m,): the requested grid up to the end of the run, else the steps with every event time twice."""
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
        """States (n,) at the end of the run; they are available for every value of ``save``."""
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
        """Names of what `output` gives in addition to the states.

        For a model: outputs, inputs and definitions, discrete states, and relative velocities ``v_rel(f)``. For a
        `MechanicalSystem`: the forces by the names of contacts and impacts, ``v_rel(f)``, and with ``moreau`` the
        gaps ``gap(p)`` of impacts.
        """
        return self._trajectory.quantities

    @refusing
    def output(self, name: str, t: Any = None, side: str = "+") -> np.ndarray:
        """Return a quantity over time: a state, output, input, definition, or variable of a mode.

        ``v_rel(f)`` is the relative velocity of a contact f that can stick. A `MechanicalSystem` has the force
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
            remedy = nearest(str(name), known, kind="quantities")
            for contact in self.model.contacts:
                if str(name) == relative_velocity(contact.name):
                    remedy = f"declare it as an output: {contact.velocity.text}"
            raise UsageError(f"model {self.model.name} has no quantity {name!r}", remedy=remedy)
        if t is None and self._grid is None:
            return self._trajectory.own_values(name)
        requested = self.t if t is None else t
        values = self._trajectory.values(name, *self._within(as_times(requested), side))
        return values[0] if np.ndim(requested) == 0 else values

    def _outside(self, times: np.ndarray) -> np.ndarray | None:
        """Return a mask of the times that are NaN or outside the kept part of the run; None if there are none."""
        low, high = self.t_start, self.t_end
        if high < low:
            low, high = high, low
        if not len(times) or (times.min() >= low and times.max() <= high):
            return None
        return ~((times >= low) & (times <= high))

    def _within(self, times: np.ndarray, side: str) -> tuple[np.ndarray, str]:
        """Return times and side after checking that the run holds the states there."""
        side = side_of_event(side)
        if not self._trajectory.has_states:
            raise UsageError(f"the run has no trajectory ({self.status}: {self.message})")
        if self._save in ("events", "nothing"):
            raise UsageError(
                f"the run was made with save={self._save!r}, which keeps no states between the ends",
                remedy="run it with save='all', or with save='last-period' or a number for the end of it",
            )
        if (outside := self._outside(times)) is not None:
            bad, (low, high) = times[outside][0], sorted((self.t_start, self.t_end))
            whole = (
                "the run" if self._save == "all" else f"the part of the run that save={self._save!r} stores"
            )
            raise UsageError(
                f"t = {float(bad)!r} is outside {whole}, which covers t = {low!r} to {high!r}",
                remedy="use times in this range",
            )
        return times, side

    # -- events and modes -----------------------------------------------------------------------------------

    @property
    def events(self) -> Sequence[Event]:
        """All events in order of time: transitions, monitors, scheduled events, near-grazings.

        With ``moreau`` for a `MechanicalSystem` an event is at the beginning of the step with the new mode, and
        bounces are not events.
        """
        self._require_events()
        return self._trajectory.events

    @property
    def corners(self) -> tuple[Event, ...]:
        """The instants at which a corner (`abs`, `min`, `max`) inside a mode changed its side: kind "corner".

        The model does not change there: the run continues with the equations of the other side. `events` and
        `modes` do not contain these instants. A `MechanicalSystem` has none.
        """
        self._require_events()
        return self._trajectory.corners

    def explain(self, number: int | Event) -> Explanation:
        """Explain an event: guards that reached zero, modes that could hold just after, and the reason.

        Parameters
        ----------
        number : the index of the event in `events`, or an event of `events` or `corners`.

        Raises
        ------
        UsageError
            If there is no such event, ``save`` did not keep the data that is needed, or a `MechanicalSystem` was
            simulated.

        Examples
        --------
        >>> import hybridsim as hs
        >>> sol = hs.simulate("dfcs", t_span=(0, 0.01))
        >>> print(sol.explain(0).reason)
        slip+ is the only mode that is admissible just after
        """
        from hybridsim.solution.explain.explanation import explain

        return explain(self, number)

    @refusing
    def event_times(self, component: str, kind: str | None = None) -> np.ndarray:
        """Return the times (m,) of the events of one component, contact, impact, monitor or schedule."""
        self._check_component(component, kind)
        return self._trajectory.event_times(component, kind)

    @refusing
    def event_states(self, component: str, kind: str | None = None, side: str = "+") -> np.ndarray:
        """Return the states (m, n) at the m events of one component, in the order of `event_times`.

        With side "+" these are the states x+ just after each event, with "-" the states x-; columns are in
        the order of ``sol.names``. The values equal those in ``sol.events``, without an object for each
        event.
        """
        side = side_of_event(side)
        self._check_component(component, kind)
        return self._trajectory.event_states(component, kind, side)

    def _check_component(self, component: object, kind: object) -> None:
        self._require_events()
        if kind is not None:
            text(kind, "kind")
        known = self._trajectory.event_names
        if not isinstance(component, str) or component not in known:
            raise UsageError(
                f"the model has no component, monitor or schedule {component!r}",
                remedy=nearest(str(component), list(known), kind="names"),
            )

    @property
    def components(self) -> Sequence[Any]:
        """Objects with the names of `modes`, in order.

        They are the components of a model and those for jumps in its rates, or the contacts and impacts of a
        `MechanicalSystem`.
        """
        return self._trajectory.components

    @property
    def modes(self) -> dict[str, tuple[ModeInterval, ...]]:
        """The modes of each component in order, with the time interval of each, in the unit of t."""
        self._require_events()
        return self._trajectory.modes

    def _require_events(self) -> None:
        if self._save == "nothing":
            raise UsageError(
                "the run was made with save='nothing', which keeps no events and no modes",
                remedy="run it with save='events', or 'last-period'",
            )

    # -- how it went ----------------------------------------------------------------------------------------

    @property
    def status(self) -> str:
        """How the run ended: "finished" at t1, "terminated" by a monitor or schedule, else the reason it stopped."""
        return self._trajectory.status

    @property
    def success(self) -> bool:
        """Whether the run reached its end or was terminated by a monitor or schedule."""
        return self.status in _GOOD

    @property
    def chosen_because(self) -> str:
        """Why `auto` chose the integrator, as text; empty if the integrator was named or there was no choice."""
        return self._trajectory.reason

    @property
    def message(self) -> str:
        """One sentence about how the run ended."""
        return self._trajectory.message

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the run: near-grazings, undecided events, accumulation, chattering, jumps, stiffness."""
        return self._trajectory.warnings

    @property
    def stats(self) -> dict[str, float]:
        """Cost summed over all restarts: counts of steps, evaluations, events and restarts; times in seconds.

        wall_time covers the whole run. kernel_time is the part of it in the compiled mode loop, for methods
        that have one. A `MechanicalSystem` counts steps of the whole system, ``nodes_restarted``, and with ``moreau``
        sweeps over the contacts and bounces; ``residual`` is then the largest residual of any step, the last
        change of an impulse relative to the largest impulse of its step.
        """
        return self._trajectory.stats

    @property
    def work(self) -> dict[str, float]:
        """Energy that a `MechanicalSystem` gets over a run with ``moreau``, in units of force times position.

        The sources are ``forcing``, ``damping``, ``friction``, ``impacts`` and the moving ``bases`` of its
        contacts. Those of damping, friction and impacts are not positive, up to rounding in a step. With
        theta = 1/2 they add up to the gain of kinetic and elastic energy. Other runs do not have this attribute.
        """
        return self._measured("work", self._trajectory.work, 'a MechanicalSystem with integrator="moreau"')

    def _measured(self, name: str, value: Any, where: str) -> Any:
        if value is None:
            raise AttributeError(f"this Solution has no {name}: only a run of {where} has it", name=name)
        return value

    # -- on disk, and on ------------------------------------------------------------------------------------

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle a solution as it is saved to a file; a model with Python functions cannot be pickled."""
        from hybridsim.solution.files.archive import of_bytes, to_bytes

        if not isinstance(self._trajectory, ModelTrajectory):
            return Solution, (self._trajectory,)
        return of_bytes, (to_bytes(self),)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the run to one file: the model, its settings, the trajectory, and the checkpoint to resume from.

        `hybridsim.load_solution` reads it. The file is a zip of NumPy arrays and one text; it contains no
        code.

        Parameters
        ----------
        path : the file; the usual suffix is .hsol.

        Raises
        ------
        UsageError
            For a model of Python functions or a `MechanicalSystem`, or if the file cannot be written.
        """
        from hybridsim.solution.files.archive import save

        save(self, path)

    @refusing
    def resume(
        self,
        t_end: float | None = None,
        *,
        limits: Mapping[str, float] | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Solution:
        """Resume the run from just after its last event, and return the solution of the whole run.

        The result is bit for bit that of an uninterrupted run: after Ctrl-C, after a limit, or beyond the
        original end. Beyond the original end it agrees only to the tolerances for the methods of SciPy and
        SUNDIALS and for ``rodas5p``, because their first step depends on the distance to the end.

        Parameters
        ----------
        t_end : the new end; without it the original end.
        limits, progress : as in `simulate`; limits count from here.

        Raises
        ------
        UsageError
            If the run has already reached its end, or cannot continue (a terminating monitor, an error, a
            `MechanicalSystem`).

        Examples
        --------
        >>> import hybridsim as hs
        >>> part = hs.simulate("dfcs", t_span=(0, 0.1), limits={"events": 5}, integrator="scipy-dop853")
        >>> part.status, part.resume().status
        ('limit', 'finished')
        """
        from hybridsim.solution.resume import resumed

        return resumed(self, t_end, limits, progress)

    # -- as SciPy's OdeResult --------------------------------------------------------------------------------

    @property
    def sol(self) -> Solution:
        """The dense output, under SciPy's name."""
        return self

    @property
    def nfev(self) -> int:
        """Evaluations of the right-hand side, under SciPy's name; a `MechanicalSystem` does not count them."""
        return self._measured("nfev", self.stats.get("rhs_evaluations"), "a Model")

    @property
    def t_events(self) -> list[np.ndarray]:
        """Times of each monitor in the order of declaration, under SciPy's name."""
        return [self.event_times(name, "monitor") for name in self._monitors]

    @property
    def y_events(self) -> list[np.ndarray]:
        """States (events, n) of each monitor, under SciPy's name."""
        found = [
            [e.x_minus for e in self.events if e.component == name and e.kind == "monitor"]
            for name in self._monitors
        ]
        return [np.array(rows).reshape(-1, len(self.names)) for rows in found]

    @property
    def _monitors(self) -> list[str]:
        return [monitor.name for monitor in getattr(self.model, "monitors", ())]

    # -- tables ---------------------------------------------------------------------------------------------

    def table(self, points: int | None = None) -> Table:
        """Return times, states, quantities and modes as columns, at ``sol.t`` or at equally spaced times."""
        if points is None and self._grid is None:
            return self._trajectory.table(None)
        times = self.t if points is None else equal_steps(self.t_start, self.t_end, points)
        if len(times):
            self._within(times, "+")
        return self._trajectory.table(times)

    def __repr__(self) -> str:
        return as_text(self)

    def _repr_html_(self) -> str:
        """Return the HTML for notebooks: a summary, a strip of modes for each component, and the events."""
        return in_html(self)
