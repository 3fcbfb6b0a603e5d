"""This module defines the result of a run: times, states, dense output, events, modes, outputs and cost."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.arguments import as_times, side_of_event, text
from hybridsim.calls import refusing
from hybridsim.engine.record.time_lookup import Frame, locate_times
from hybridsim.errors import UsageError, nearest
from hybridsim.presentation.tables import Table
from hybridsim.solution.by_name import ByName
from hybridsim.solution.event import Event, ModeInterval
from hybridsim.solution.files.in_tables import InTables
from hybridsim.solution.summary import as_text, in_html

if TYPE_CHECKING:
    from hybridsim.engine.record.block_list import SegmentBlockList
    from hybridsim.engine.record.segments import Segment
    from hybridsim.engine.record.trajectory import Trajectory
    from hybridsim.model.parts.component import Component
    from hybridsim.solution.explain.explanation import Explanation
    from hybridsim.solution.run import Run

_GOOD = ("finished", "terminated")


def _speed(contact: str) -> str:
    """Return the name under which `Solution.output` gives the relative velocity of a contact."""
    return f"v_rel({contact})"


class Solution(InTables):
    """The result of `simulate`; ``sol(t)`` is the dense output.

    Attributes
    ----------
    t, y : array
        Times (m,) and states (n, m), as in SciPy: one row per state and one column per time. The rows follow
        the order of declaration (``names``), then the states of friction laws. An event time appears twice,
        with x- and x+.
    events, modes, stats, status, success, message, warnings : object
        See the properties.

    Other Parameters
    ----------------
    run, trajectory, wall_time, compile_time : object
        Passed on by `simulate`; do not construct a solution by hand.

    Examples
    --------
    >>> import hybridsim as hs
    >>> sol = hs.simulate("dfcs", (0, 0.1))
    >>> sol(0.05).shape, len(sol.events)
    ((2,), 27)
    >>> sol.names
    ('x', 'v')
    """

    def __init__(
        self,
        run: Run,
        trajectory: Trajectory,
        wall_time: float,
        compile_time: float,
    ) -> None:
        self.model = run.model
        self.integrator = run.method.name
        self._run, self._system, self._trajectory = run, run.system, trajectory
        self._grid, self._save, self._reason = run.grid, run.save, run.reason
        self._span = (run.task.t0, run.task.t1)
        self._cost = (wall_time, compile_time)

    # -- trajectory -----------------------------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the states, in the order of the rows of y."""
        return self._system.names

    @cached_property
    def t(self) -> np.ndarray:
        """Times (m,): the requested grid up to the end of the run, else the steps with every event time twice."""
        if self._grid is not None:
            if not self._segments:
                return self._grid[:0]
            outside = self._outside(self._grid)
            return self._grid if outside is None else self._grid[~outside]
        (index, s, _), (starts, ends, origins, _) = self._knots, self._frame
        times = origins[index, 0] + (s + origins[index, 1])
        counts = np.bincount(index, minlength=len(starts))
        last = np.cumsum(counts) - 1
        times[last - counts + 1], times[last] = starts, ends  # s is rounded there
        return times

    @cached_property
    def y(self) -> np.ndarray:
        """States (n, m) at the times t."""
        return self(self.t) if self._grid is not None else self._knots[2].T

    @cached_property
    def _knots(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self._segments.knots()

    @property
    def _segments(self) -> SegmentBlockList:
        return self._trajectory.segments

    @property
    def t_start(self) -> float:
        """First time of the run, or of the stored part of the run."""
        whole = self._save in ("all", "events", "nothing") or not self._segments
        return self._span[0] if whole else float(self._starts[0])

    @property
    def t_end(self) -> float:
        """Last time that the run reached."""
        if self.status == "finished":
            return self._span[1]
        return float(self._segments[-1].end) if self._segments else self._span[0]

    def __call__(self, t: Any, side: str = "+") -> np.ndarray:
        """Return the states at time t: (n,) for a number, (n, k) for k times.

        With side "+" the result is right-continuous, x+ at an event; "-" gives x-.
        """
        times = as_times(t)
        x = self._segments.states(*self._segment_at(times, side))
        return x[0] if np.ndim(t) == 0 else x.T

    @refusing
    def output(self, name: str, t: Any = None, side: str = "+") -> np.ndarray:
        """Return a quantity over time: a state, output, input, definition, or variable of a mode.

        ``v_rel(f)`` is the relative velocity of a contact f that can stick.

        Parameters
        ----------
        name : the name of the quantity.
        t : a number or an array of times; without it ``sol.t``, with both sides of each event time.
        """
        known = (*self._system.names, *(q for q in self._system.quantities if " in " not in q))
        known = (*known, *(d.name for d in self.model.discrete))
        if not isinstance(name, str) or name not in (*known, *self._speeds):
            remedy = nearest(str(name), (*known, *self._speeds), kind="quantities")
            for contact in self.model.contacts:
                if str(name) == _speed(contact.name):
                    remedy = f"declare it as an output: {contact.velocity.text}"
            raise UsageError(f"model {self.model.name} has no quantity {name!r}", remedy=remedy)
        if t is None and self._grid is None:
            parts = [self._quantity(name, g, g.s, g.x) for g in self._segments]
            return np.concatenate(parts) if parts else np.zeros(0)
        requested = self.t if t is None else t
        times = as_times(requested)
        out = np.empty(len(times))
        x, by_segment = self._by_segment(times, side)
        for segment, chosen, s in by_segment:
            out[chosen] = self._quantity(name, segment, s, x[chosen])
        return out[0] if np.ndim(requested) == 0 else out

    @cached_property
    def _speeds(self) -> dict[str, int]:
        """The relative velocities of contacts by name, each with its index among the surfaces."""
        contacts = {contact.name for contact in self.model.contacts}
        components = [self._system.automata[c].name for c in self._system.surface_of]
        return {_speed(name): k for k, name in enumerate(components) if name in contacts}

    def _quantity(self, name: str, segment: Segment, s: np.ndarray, x: np.ndarray) -> np.ndarray:
        if name in self.names:
            return x[:, self.names.index(name)]
        if name in self._speeds:
            system = self._system
            rows = system.rows("surfaces", len(system.surface_of), s, x, segment.p, segment.z)
            return rows[:, self._speeds[name]]
        return self._quantities([name], segment, s, x)[0]

    def _quantities(
        self, names: Sequence[str], segment: Segment, s: np.ndarray, x: np.ndarray
    ) -> list[np.ndarray]:
        """Return discrete states and other quantities that are not states, at points of a segment."""
        system = self._system
        discrete = [d.name for d in self.model.discrete]
        known = system.quantities
        values = np.zeros((len(s), 0))
        if any(name not in discrete for name in names):
            values = system.rows("quantities", len(known), s, np.ascontiguousarray(x), segment.p, segment.z)
        modes = [f"{a.name}.{a.modes[m]}" for a, m in zip(system.automata, segment.z, strict=True)]
        found = []
        for name in names:
            if name in discrete:
                found.append(np.full(len(s), segment.p[system.layout.discrete_at + discrete.index(name)]))
                continue
            special = [f"{name} in {mode}" for mode in modes if f"{name} in {mode}" in known]
            found.append(values[:, known.index(special[-1] if special else name)])
        return found

    @cached_property
    def _frame(self) -> Frame:
        segments = self._segments
        return Frame.of(segments.origins(), segments.spans(), self.t_end)

    @property
    def _starts(self) -> np.ndarray:
        return self._frame.starts

    @property
    def _ends(self) -> np.ndarray:
        return self._frame.ends

    def _outside(self, times: np.ndarray) -> np.ndarray | None:
        """Return a mask of the times that are NaN or outside the kept part of the run; None if there are none."""
        low, high = self.t_start, self.t_end
        if high < low:
            low, high = high, low
        if not len(times) or (times.min() >= low and times.max() <= high):
            return None
        return ~((times >= low) & (times <= high))

    def _segment_at(self, times: np.ndarray, side: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the number of the segment that holds each time, and the local time in it."""
        side = side_of_event(side)
        if not self._segments:
            raise UsageError(f"the run has no trajectory ({self.status}: {self.message})")
        if self._save in ("events", "nothing"):
            raise UsageError(
                f"the run was made with save={self._save!r}, which keeps no states between the ends",
                remedy="run it with save='all', or with save='last-period' or a number for the end of it",
            )
        if (outside := self._outside(times)) is not None:
            bad, (low, high) = times[outside][0], sorted((self.t_start, self.t_end))
            whole = "the run" if self._save == "all" else f"what save={self._save!r} keeps of the run"
            raise UsageError(
                f"t = {float(bad)!r} is outside of {whole}, which covers t = {low!r} to {high!r}",
                remedy="give times in this range",
            )
        sign = 1.0 if self.t_end >= self.t_start else -1.0
        # Right-continuous in time: at an event time take the later segment forward, the earlier one backward.
        later = (side == "+") == (sign > 0)
        index, s = np.empty(len(times), dtype=np.int64), np.empty(len(times))
        locate_times(np.ascontiguousarray(times), *self._frame, sign, later, index, s)
        return index, s

    def _by_segment(
        self, times: np.ndarray, side: str
    ) -> tuple[np.ndarray, list[tuple[Segment, np.ndarray, np.ndarray]]]:
        """Return states (k, n) at some times, and (segment, indices, local times) for each segment."""
        index, s = self._segment_at(times, side)
        parts = [(i, np.flatnonzero(index == i)) for i in np.unique(index)]
        by_segment = [(self._segments[int(i)], chosen, s[chosen]) for i, chosen in parts]
        return self._segments.states(index, s), by_segment

    # -- events and modes -----------------------------------------------------------------------------------

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """All events in order of time: transitions, monitors, scheduled events, near-grazings."""
        self._require_events()
        return tuple(event for event in self._happened if event.kind != "corner")

    @property
    def corners(self) -> tuple[Event, ...]:
        """The instants at which a corner (`abs`, `min`, `max`) inside a mode changed its side: kind "corner".

        The model does not change there: the run continues with the equations of the other side. `events` and
        `modes` do not contain these instants.
        """
        self._require_events()
        return tuple(event for event in self._happened if event.kind == "corner")

    @cached_property
    def _happened(self) -> tuple[Event, ...]:
        return tuple(Event(float(o.instant), *o[1:]) for o in self._trajectory.occurrences)

    def explain(self, number: int | Event) -> Explanation:
        """Explain an event: guards that reached zero, modes that could hold just after, and the reason.

        Parameters
        ----------
        number : the index of the event in `events`, or an event of `events` or `corners`.

        Raises
        ------
        UsageError
            If there is no such event, or ``save`` did not keep the data that is needed.

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
        """Return the times of the events of one component, monitor or schedule."""
        found = [block.times_of(component, kind) for block in self._blocks_with(component, kind)]
        return found[0] if len(found) == 1 else np.concatenate([np.empty(0), *found])

    @refusing
    def event_states(self, component: str, kind: str | None = None, side: str = "+") -> np.ndarray:
        """Return the states (m, n) at the m events of one component, in the order of `event_times`.

        With side "+" these are the states x+ just after each event, with "-" the states x-; columns are in
        the order of ``sol.names``. The values equal those in ``sol.events``, without an object for each
        event.
        """
        side = side_of_event(side)
        found = [
            block.states_of(component, kind, "-+".index(side)) for block in self._blocks_with(component, kind)
        ]
        if len(found) == 1 and len(found[0]):
            return found[0]
        return np.concatenate([np.empty((0, self._system.n)), *(states for states in found if len(states))])

    def _blocks_with(self, component: str, kind: str | None) -> list[Any]:
        """Return all blocks of records with events of a component, after checking its name."""
        self._require_events()
        if kind is not None:
            text(kind, "kind")
        if not isinstance(component, str) or component not in self._system.event_names:
            known = list(self._system.event_names)
            raise UsageError(
                f"the model has no component, monitor or schedule {component!r}",
                remedy=nearest(str(component), known, kind="names"),
            )
        return self._trajectory.occurrences.blocks

    @property
    def components(self) -> tuple[Component, ...]:
        """Components listed in `modes`: components of the model, and components for jumps in its rates."""
        return tuple(self._system.model.all_components()[: len(self._system.declared)])

    @cached_property
    def modes(self) -> dict[str, tuple[ModeInterval, ...]]:
        """The modes of each component in order, with the time interval of each."""
        self._require_events()
        if self._save == "events":
            return self._modes_of_events()
        numbers, ends = self._segments.modes(), self._ends
        result = ByName[tuple[ModeInterval, ...]]()
        for c, automaton in enumerate(self._system.declared):
            changed = np.flatnonzero(np.diff(numbers[:, c])) + 1
            first = np.concatenate([[0], changed]) if len(numbers) else changed
            last = np.append(changed, len(numbers))[: len(first)] - 1
            names = [automaton.modes[m] for m in numbers[first, c].tolist()]
            intervals = zip(names, self._starts[first].tolist(), ends[last].tolist(), strict=True)
            result[automaton.name] = tuple(ModeInterval(*interval) for interval in intervals)
        return result

    def _modes_of_events(self) -> dict[str, tuple[ModeInterval, ...]]:
        result = ByName[tuple[ModeInterval, ...]]()
        for automaton, last in zip(self._system.declared, self._segments.modes()[-1].tolist(), strict=False):
            changes = [e for e in self.events if e.component == automaton.name and e.source != e.target]
            times = [self.t_start, *(e.t for e in changes), self.t_end]
            names = [*(e.source for e in changes), automaton.modes[last]]
            intervals = zip(names, times[:-1], times[1:], strict=True)
            result[automaton.name] = tuple(
                ModeInterval(n, a, b) for n, a, b in intervals if a != b or b == times[-1]
            )
        return result

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
        """Why `auto` chose the integrator, as text; empty if the integrator was named."""
        return self._reason

    @property
    def message(self) -> str:
        """One sentence about how the run ended."""
        why = f", chosen because {self._reason}" if self._reason else ""
        how = " backward in time" if self.t_end < self.t_start else ""
        if taken_over := self._trajectory.taken_over:
            why += (
                f"; from t = {taken_over[1]:.9g} on with {taken_over[0]}, because stability, not accuracy, limited its "
                "steps"
            )
        return self._trajectory.message or f"reached t = {self.t_end!r}{how} with {self.integrator}{why}"

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the run: near-grazings, undecided events, accumulation, chattering, jumps, stiffness."""
        return tuple(f"{m} ({n} times)" if n > 1 else m for m, n in self._trajectory.warnings.items())

    @property
    def stats(self) -> dict[str, float]:
        """Cost summed over all restarts: counts of steps, evaluations, events and restarts; times in seconds.

        wall_time covers the whole run. kernel_time is the part of it in the compiled mode loop, for methods
        that have one.
        """
        counters = self._trajectory.counters
        return {**vars(counters), "wall_time": self._cost[0], "compile_time": self._cost[1]}

    # -- on disk, and on ------------------------------------------------------------------------------------

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle a solution as it is saved to a file; a model with Python functions cannot be pickled."""
        from hybridsim.solution.files.archive import of_bytes, to_bytes

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
            For a model of Python functions, or if the file cannot be written.
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
            If the run has already reached its end, or cannot continue (a terminating monitor, an error).

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
        """Evaluations of the right-hand side, under SciPy's name."""
        return self._trajectory.counters.rhs_evaluations

    @property
    def t_events(self) -> list[np.ndarray]:
        """Times of each monitor in the order of declaration, under SciPy's name."""
        return [self.event_times(m.name, "monitor") for m in self.model.monitors]

    @property
    def y_events(self) -> list[np.ndarray]:
        """States (events, n) of each monitor, under SciPy's name."""
        found = [
            [e.x_minus for e in self.events if e.component == m.name and e.kind == "monitor"]
            for m in self.model.monitors
        ]
        return [np.array(rows).reshape(-1, self._system.n) for rows in found]

    # -- tables ---------------------------------------------------------------------------------------------

    def table(self, points: int | None = None) -> Table:
        """Return times, states, outputs and modes as columns, at ``sol.t`` or at equally spaced times."""
        from hybridsim.solution.files.tabulated import tabulated

        return tabulated(self, points)

    def __repr__(self) -> str:
        return as_text(self)

    def _repr_html_(self) -> str:
        """Return the HTML for notebooks: a summary, a strip of modes for each component, and the events."""
        return in_html(self)
