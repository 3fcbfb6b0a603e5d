"""This module computes the results of a solution from the record of a run of a `Model`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.engine.record.time_lookup import Frame, locate_times
from hybridsim.presentation.readable import cost_text
from hybridsim.solution.by_name import ByName
from hybridsim.solution.event import ModeInterval, counted_kind
from hybridsim.solution.files.tabulated import SegmentConstants, at_steps, constants_of, tabulated
from hybridsim.solution.model_events import ModelEvents
from hybridsim.solution.run import Run
from hybridsim.solution.run_trajectory import contacts_without_stick, relative_velocity, velocity_of

if TYPE_CHECKING:
    from hybridsim.engine.record.block_list import SegmentBlockList
    from hybridsim.engine.record.segments import Segment
    from hybridsim.engine.record.trajectory import Trajectory
    from hybridsim.model.parts.component import Component
    from hybridsim.model.parts.contact import Contact
    from hybridsim.presentation.tables import Table


class ModelTrajectory(ModelEvents):
    """The trajectory of a run of a `Model`, from which a solution reads its results."""

    work = None

    def __init__(self, run: Run, record: Trajectory, wall_time: float, compile_time: float) -> None:
        self.model, self.integrator = run.model, run.method.name
        self.run, self.system, self.record = run, run.system, record
        self.grid, self.save, self.reason = run.grid, run.save, run.reason
        self.cost = (wall_time, compile_time)

    # -- times and states -----------------------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the states."""
        return self.system.names

    @property
    def segments(self) -> SegmentBlockList:
        """Return the stored segments of the run."""
        return self.record.segments

    @property
    def has_states(self) -> bool:
        """Return whether any segment is stored."""
        return bool(self.segments)

    @property
    def t_start(self) -> float:
        """Return the first time of the run, or of its stored part."""
        whole = self.save in ("all", "events", "nothing") or not self.segments
        return self.run.task.t0 if whole else float(self.frame.starts[0])

    @property
    def t_end(self) -> float:
        """Return the last time that the run reached."""
        if self.status == "finished":
            return self.run.task.t1
        return float(self.segments[-1].end) if self.segments else self.run.task.t0

    @cached_property
    def frame(self) -> Frame:
        """Return the start and end times of all segments."""
        return Frame.of(self.segments.origins(), self.segments.spans(), self.t_end)

    @cached_property
    def _knots(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.segments.knots()

    @property
    def own_times(self) -> np.ndarray:
        """Return the times (m,) of the steps; every event time occurs twice."""
        (index, s, _), (starts, ends, origins, _) = self._knots, self.frame
        times = origins[index, 0] + (s + origins[index, 1])
        counts = np.bincount(index, minlength=len(starts))
        last = np.cumsum(counts) - 1
        times[last - counts + 1], times[last] = starts, ends  # s is rounded there
        return times

    @property
    def own_states(self) -> np.ndarray:
        """Return the states (n, m) at the steps of the run."""
        return self._knots[2].T

    @property
    def x_end(self) -> np.ndarray:
        """Return the states (n,) at the end of the run."""
        return self.segments[-1].x[-1].copy() if self.segments else self.run.task.x0.copy()

    def segment_at(self, times: np.ndarray, side: str) -> tuple[np.ndarray, np.ndarray]:
        """Return, for each time, the index of its segment and the local time in this segment."""
        sign = 1.0 if self.t_end >= self.t_start else -1.0
        # Right-continuous in time: at an event time take the later segment forward, the earlier one backward.
        later = (side == "+") == (sign > 0)
        index, s = np.empty(len(times), dtype=np.int64), np.empty(len(times))
        locate_times(np.ascontiguousarray(times), *self.frame, sign, later, index, s)
        return index, s

    def states(self, times: np.ndarray, side: str) -> np.ndarray:
        """Return the states (k, n) at given times."""
        return self.segments.states(*self.segment_at(times, side))

    def by_segment(
        self, times: np.ndarray, side: str
    ) -> tuple[np.ndarray, list[tuple[SegmentConstants, np.ndarray, np.ndarray]]]:
        """Return states (k, n) at given times, and for each segment its constants, indices and local times."""
        index, s = self.segment_at(times, side)
        order = np.argsort(index, kind="stable")
        found, first = np.unique(index[order], return_index=True)
        starts, blocks = self.segments.starts(), self.segments.blocks
        block = np.searchsorted(starts, found, side="right") - 1
        within = zip(block.tolist(), (found - starts[block]).tolist(), np.split(order, first[1:]))
        by_segment = [(constants_of(blocks[b], i), chosen, s[chosen]) for b, i, chosen in within]
        return self.segments.states(index, s), by_segment

    # -- quantities -----------------------------------------------------------------------------------------

    @property
    def quantities(self) -> tuple[str, ...]:
        """Return the names of outputs, inputs and definitions, discrete states and relative velocities."""
        common = (q for q in self.system.quantities if " in " not in q)
        discrete = (d.name for d in self.model.discrete)
        return (*common, *discrete, *self._velocities, *self._velocities_without_stick)

    @cached_property
    def _velocities(self) -> dict[str, int]:
        """The relative velocities of contacts with stick by name, each with its index among the surfaces."""
        contacts = {contact.name for contact in self.model.contacts}
        components = [self.system.automata[c].name for c in self.system.surface_of]
        return {relative_velocity(name): k for k, name in enumerate(components) if name in contacts}

    @cached_property
    def _velocities_without_stick(self) -> dict[str, Contact]:
        """The contacts without stick by the names of their relative velocities."""
        return contacts_without_stick(self.model, self._velocities)

    def own_values(self, name: str) -> np.ndarray:
        """Return the values of a quantity at the steps of the run."""
        parts = [self.values_at([name], g, g.s, g.x)[0] for g in self.segments]
        return np.concatenate(parts) if parts else np.zeros(0)

    def values(self, name: str, times: np.ndarray, side: str) -> np.ndarray:
        """Return the values (k,) of a quantity at given times."""
        return self.values_of([name], times, side)[0]

    def values_of(self, names: Sequence[str], times: np.ndarray, side: str) -> np.ndarray:
        """Return the values (m, k) of several quantities at given times."""
        if all(name in self.names for name in names):
            return self.states(times, side).T[[self.names.index(name) for name in names]]
        out = np.empty((len(names), len(times)))
        x, by_segment = self.by_segment(times, side)
        for segment, chosen, s in by_segment:
            out[:, chosen] = self.values_at(names, segment, s, x[chosen])
        return out

    def friction_powers(self, times: np.ndarray) -> np.ndarray:
        """Return the friction force times the relative velocity (k, contacts) of each contact at times (k,)."""
        contacts = self.model.contacts
        forces = self.values_of([contact.name for contact in contacts], times, "+")
        speeds = self.values_of([relative_velocity(contact.name) for contact in contacts], times, "+")
        return forces.T * speeds.T

    def values_at(
        self, names: Sequence[str], segment: Segment | SegmentConstants, s: np.ndarray, x: np.ndarray
    ) -> list[np.ndarray]:
        """Return the values of states and quantities at points of a segment."""
        system = self.system
        found = {name: x[:, self.names.index(name)] for name in names if name in self.names}
        if any(name in self._velocities for name in names):
            rows = system.rows("surfaces", len(system.surface_of), s, x, segment.p, segment.z)
            found |= {name: rows[:, k] for name, k in self._velocities.items() if name in names}
        for name, contact in self._velocities_without_stick.items():
            if name in names:
                read = [n for n in contact.velocity.names if n in self.names or n in self.quantities]
                values = dict(zip(read, self.values_at(read, segment, s, x), strict=True))
                times = segment.p[system.layout.origin_at] + s
                found[name] = velocity_of(contact, values, times, self.model.parameter_values())
        others = [name for name in names if name not in found]
        found |= dict(zip(others, self.values_in(others, segment, s, x), strict=True))
        return [found[name] for name in names]

    def values_in(
        self, names: Sequence[str], segment: Segment | SegmentConstants, s: np.ndarray, x: np.ndarray
    ) -> list[np.ndarray]:
        """Return the values of quantities other than continuous states, at points of a segment."""
        system = self.system
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

    def table(self, times: np.ndarray | None) -> Table:
        """Return states, quantities and modes at given times as columns."""
        if times is None:
            parts: Sequence[Any] = at_steps(self.segments)
            t, x = self.own_times, self.own_states.T
        else:
            nothing: tuple[np.ndarray, Sequence[Any]] = np.zeros((0, len(self.names))), []
            t, (x, parts) = times, self.by_segment(times, "+") if len(times) else nothing
        return tabulated(self.run, self.status, t, x, parts, self.values_in)

    # -- modes -----------------------------------------------------------------------------------

    @property
    def components(self) -> tuple[Component, ...]:
        """Return the components of the model, including components that were added for jumps in its rates."""
        return tuple(self.system.model.all_components()[: len(self.system.declared)])

    @cached_property
    def modes(self) -> dict[str, tuple[ModeInterval, ...]]:
        """Return the modes of each component in order."""
        if self.save == "events":
            return self._modes_of_events()
        numbers, (starts, ends, *_) = self.segments.modes(), self.frame
        result = ByName[tuple[ModeInterval, ...]]()
        for c, automaton in enumerate(self.system.declared):
            changed = np.flatnonzero(np.diff(numbers[:, c])) + 1
            first = np.concatenate([[0], changed]) if len(numbers) else changed
            last = np.append(changed, len(numbers))[: len(first)] - 1
            names = [automaton.modes[m] for m in numbers[first, c].tolist()]
            intervals = zip(names, starts[first].tolist(), ends[last].tolist(), strict=True)
            result[automaton.name] = tuple(ModeInterval(*interval) for interval in intervals)
        return result

    def _modes_of_events(self) -> dict[str, tuple[ModeInterval, ...]]:
        result = ByName[tuple[ModeInterval, ...]]()
        for automaton, last in zip(self.system.declared, self.segments.modes()[-1].tolist(), strict=False):
            changes = [e for e in self.events if e.component == automaton.name and e.source != e.target]
            times = [self.t_start, *(e.t for e in changes), self.t_end]
            names = [*(e.source for e in changes), automaton.modes[last]]
            intervals = zip(names, times[:-1], times[1:], strict=True)
            result[automaton.name] = tuple(
                ModeInterval(n, a, b) for n, a, b in intervals if a != b or b == times[-1]
            )
        return result

    # -- how the run ended ----------------------------------------------------------------------------------

    @property
    def status(self) -> str:
        """Return how the run ended."""
        return self.record.status

    @property
    def message(self) -> str:
        """Return one sentence about how the run ended."""
        why = f", chosen because {self.reason}" if self.reason else ""
        how = " backward in time" if self.t_end < self.t_start else ""
        if taken_over := self.record.taken_over:
            why += (
                f"; from t = {taken_over[1]:.9g} on with {taken_over[0]}, because stability, not accuracy, limited its "
                "steps"
            )
        return self.record.message or f"reached t = {self.t_end!r}{how} with {self.integrator}{why}"

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return the warnings of the run."""
        return tuple(f"{m} ({n} times)" if n > 1 else m for m, n in self.record.warnings.items())

    @property
    def stats(self) -> dict[str, float]:
        """Return the cost of the run, summed over all segments."""
        return {**vars(self.record.counters), "wall_time": self.cost[0], "compile_time": self.cost[1]}

    def summary(self) -> list[str]:
        """Return the end state, the events by kind, and the cost."""
        counted = ", ".join(counted_kind(*found) for found in sorted(self.kinds().items()))
        lines = []
        if self.segments:
            last = self.segments[-1].x[-1]
            final = ", ".join(f"{n} = {v:.9g}" for n, v in zip(self.names, last, strict=True))
            lines.append(f"  t from {self.t_start:.9g} to {self.t_end:.9g}; at the end {final}")
        return [
            *lines,
            f"  events: {'not kept' if self.save == 'nothing' else counted or 'none'}",
            f"  cost: {cost_text(self.stats)}",
        ]
