"""This module computes the results of a solution from a Taylor run of a mechanical system."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, NoReturn, overload

import numpy as np

from hybridsim.engine.native.struct_pack import packed
from hybridsim.errors import UsageError
from hybridsim.mechanics.arrays_trajectory import ArraysTrajectory
from hybridsim.mechanics.codes import CASCADE, DONE, INCONSISTENT, LIMITED, LOST
from hybridsim.mechanics.declaration.system import MechanicalSystem
from hybridsim.mechanics.powers import work_by_source
from hybridsim.mechanics.series_loop.node_segments import NodeSegments, instants, quantities
from hybridsim.mechanics.series_loop.run import STATUS, MechanicalRun, new_scratch, new_state, reach_kernels
from hybridsim.solution.event import Event

_MODES = {0: "stick", 1: "slip+", -1: "slip-"}
_GUARDS = {-1: "", 0: "velocity", 1: "upper", 2: "lower"}
_SHOWN = 5  # events that the text of a sequence contains


class SeriesTrajectory(ArraysTrajectory):
    """The trajectory of a Taylor run of a `MechanicalSystem`."""

    integrator = "taylor"

    def __init__(
        self,
        model: MechanicalSystem,
        run: MechanicalRun,
        grid: np.ndarray | None,
        save: str,
        cost: tuple[float, float],
    ) -> None:
        super().__init__(model, model.contacts, run, grid, save, cost)
        n, place = model.n, np.argsort(run.built.dofs)
        self._columns = np.concatenate(
            [place, n + place]
        )  # in the order of the arrays, for each declared state
        event = np.concatenate([*run.events, np.zeros((0, 4), dtype=np.int64)])
        self._event = np.ascontiguousarray(event)
        self._when = instants(np.concatenate([*run.when, np.zeros((0, 3))]))
        self._place = np.argsort(run.built.contacts)

    def __reduce__(self) -> NoReturn:
        """Raise an error on pickling and copying, because copied arrays would lose their padding."""
        raise UsageError(
            'a run of a MechanicalSystem with integrator="taylor" cannot be pickled or copied',
            remedy="use the tables of the solution, such as sol.to_npz(path) or sol.table(), or run "
            "system.to_model()",
        )

    # -- times and states -----------------------------------------------------------------------------------

    @cached_property
    def _segments(self) -> NodeSegments:
        self.require_states()
        return NodeSegments(self.run.built.arrays, self.run.segments or [self.run.start_segments()])

    @cached_property
    def _scratch(self) -> tuple[Any, Any]:
        built, order = self.run.built, self.run.order
        return new_state(built, order), new_scratch(built, order)

    @property
    def t_end(self) -> float:
        """Return the last time that the run reached."""
        return float(self.run.span[1] if self.run.code == DONE else self.run.time)

    @cached_property
    def own_times(self) -> np.ndarray:
        """Return the times (m,) at which Taylor series begin; every event time occurs twice."""
        at_events = np.unique(self._when[self._when > self.t_start])
        begins = np.unique(self._segments.begins)
        starts = begins[~np.isin(begins, at_events) & (begins < self.t_end)]
        return np.sort(np.concatenate([starts, *([at_events] * 2), [self.t_end]]))

    @property
    def own_states(self) -> np.ndarray:
        """Return the states (2n, m) at the times at which Taylor series begin."""
        times, first = self.own_times, np.append(np.diff(self.own_times) == 0.0, False)
        out = self.states(times, "+")
        out[first] = self.states(times[first], "-")
        return out.T

    @property
    def x_end(self) -> np.ndarray:
        """Return the states (2n,) at the end."""
        return np.array(self.run.state.x.reshape(-1)[self._columns])

    def states(self, times: np.ndarray, side: str) -> np.ndarray:
        """Return the states (k, 2n) at given times."""
        out = self._segments.states(times, side == "+")
        if not self.run.built.arrays.unit.all():
            self._quantities(times, side, out)
        return out[:, self._columns]

    def _quantities(self, times: np.ndarray, side: str, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return forces and relative velocities (k, m) at given times; stick constraints are satisfied."""
        built, (state, scratch) = self.run.built, self._scratch
        forces, velocities = np.empty((2, len(times), len(self.components)))
        order = np.argsort(times, kind="stable")
        packs = (packed(built.arrays), packed(built.laws), packed(state), packed(scratch))
        reach_kernels(state, *packs)
        quantities(
            *packs, self._when, self._event,
            self.run.first_modes, times, order, side == "+", states, forces, velocities,
        )  # fmt: skip
        return forces, velocities

    @property
    def quantities(self) -> tuple[str, ...]:
        """Return the names of friction forces and relative velocities."""
        return (*self.event_names, *(f"v_rel({c})" for c in self.event_names))

    def values(self, name: str, times: np.ndarray, side: str) -> np.ndarray:
        """Return the values (k,) of a state, a friction force or a relative velocity at given times."""
        if name in self.names:
            return self.states(times, side)[:, self.names.index(name)]
        own = name.removeprefix("v_rel(").removesuffix(")")
        column = int(self._place[self.event_names.index(own)])
        both = self._quantities(times, side, self._segments.states(times, side == "+"))
        return both[0 if own == name else 1][:, column]

    def forces_and_velocities(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return friction forces and relative velocities (k, contacts) at times (k,), after events."""
        forces, velocities = self._quantities(times, "+", self._segments.states(times, True))
        return forces[:, self._place], velocities[:, self._place]

    @cached_property
    def work(self) -> dict[str, float]:
        """Return the energy that the system receives from each source."""
        return work_by_source(self)

    # -- events ---------------------------------------------------------------------------------------------

    @cached_property
    def events(self) -> Sequence[Event]:
        """Return all changes of mode; the states of an event are computed on demand."""
        return _Events(self)

    @cached_property
    def changes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return times, contacts and modes of all changes."""
        return self._when, self.run.built.contacts[self._event[:, 0]], self._event[:, 1:3]

    def first_mode(self, component: int) -> int:
        """Return the mode of a contact at the start."""
        return int(self.run.first_modes[self._place[component]])

    def mode_names(self, component: int) -> dict[int, str]:
        """Return the names of the modes."""
        return _MODES

    # -- how the run ended ----------------------------------------------------------------------------------

    @property
    def status(self) -> str:
        """Return how the run ended."""
        return STATUS[self.run.code]

    @property
    def message(self) -> str:
        """Return one sentence about how the run ended."""
        code, t = self.run.code, self.t_end
        if code == DONE:
            return f"reached t = {t!r} with taylor, order {self.run.order}"
        if code == LIMITED:
            return f"stopped at t = {t!r}: {self.run.limit_message}"
        names = [self.components[i].name for i in self.run.node_contacts]
        shown = ", ".join(names[:8]) + (f", ... ({len(names)} contacts)" if len(names) > 8 else "")
        reasons = {
            INCONSISTENT: "no combination of stick and slip is admissible after this time: each needs a force beyond a "
            "friction limit or a motion against a friction force. Check that no law has a slip force at v = 0 above "
            "its stick limit",
            CASCADE: "events follow each other without time advancing",
            LOST: "no step is possible from here: a friction law is not a number, or changes too fast at v = 0",
        }
        return f"stopped at t = {t!r} at contacts {shown}: {reasons[code]}"

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return the warnings of the run on near-grazings and on events that rounding leaves undecided."""
        *_, undecided, touches = self.run.state.counts.tolist()
        texts = {
            f"undecided at rounding ({undecided} times)": undecided,
            f"near-grazing ({touches} times)": touches,
        }
        return tuple(text for text, count in texts.items() if count)

    @property
    def stats(self) -> dict[str, float]:
        """Return the cost of the run: numbers of steps, events, restarts and restarted nodes, and seconds."""
        steps, events, restarts, nodes, *_ = self.run.state.counts.tolist()
        return {
            "steps": steps, "events": events, "restarts": restarts, "nodes_restarted": nodes,
            "kernel_time": self.run.kernel_time, "wall_time": self.cost[0], "compile_time": self.cost[1],
        }  # fmt: skip

    def summary(self) -> list[str]:
        """Return the number of events and the cost of the run as text."""
        stats = self.stats
        return [
            f"  events: {stats['events']}",
            f"  cost: {stats['steps']} steps, {stats['restarts']} restarts of a part, {stats['wall_time']:.3g} s",
        ]


class _Events(Sequence[Event]):
    """The events of a run, created on demand."""

    def __init__(self, trajectory: SeriesTrajectory) -> None:
        self._trajectory = trajectory

    def __len__(self) -> int:
        return len(self._trajectory.changes[0])

    @overload
    def __getitem__(self, i: int) -> Event: ...
    @overload
    def __getitem__(self, i: slice) -> list[Event]: ...
    def __getitem__(self, i: Any) -> Any:
        if isinstance(i, slice):
            return [self[k] for k in range(*i.indices(len(self)))]
        run = self._trajectory
        when, contacts, changes = run.changes
        source, target = (_MODES[z] for z in changes[i].tolist())
        states = np.full((2, len(run.names)), np.nan)
        if run.save == "all":
            states = np.concatenate([run.states(when[[i]], side) for side in "-+"])
        guard = _GUARDS[int(run._event[i, 3])]
        return Event(
            float(when[i]), "transition", run.event_names[contacts[i]], guard, source, target, -1, *states
        )

    def __iter__(self) -> Iterator[Event]:
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        shown = ", ".join(map(repr, self[:_SHOWN]))
        return (
            f"<{len(self)} events: {shown}{', ...' if len(self) > _SHOWN else ''}>" if self else "<0 events>"
        )
