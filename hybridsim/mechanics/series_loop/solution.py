"""This module defines the result of a Taylor run of a mechanical system."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from hybridsim.arguments import as_times, known_name, side_of_event
from hybridsim.engine.native.struct_pack import packed
from hybridsim.errors import UsageError
from hybridsim.mechanics.arrays import CASCADE, DONE, INCONSISTENT, LIMITED, LOST
from hybridsim.mechanics.result import ArraysResult
from hybridsim.mechanics.series_loop.run import STATUS, new_scratch, new_state, reach_kernels
from hybridsim.mechanics.series_loop.trajectory import NodeSegments, instants, quantities
from hybridsim.solution import Event, ModeInterval
from hybridsim.solution.by_name import ByName

if TYPE_CHECKING:
    from hybridsim.mechanics.declaration.system import MechanicalSystem
    from hybridsim.mechanics.series_loop.run import MechanicalRun

_MODES = {0: "stick", 1: "slip+", -1: "slip-"}
_GUARDS = {-1: "", 0: "velocity", 1: "upper", 2: "lower"}


class MechanicalSolution(ArraysResult):
    """The result of simulating a `MechanicalSystem`; ``sol(t)`` is the dense output, positions before velocities.

    Attributes
    ----------
    t, y : array
        Times (k,) and states (2n, k): the positions in the order of declaration, then the velocities. An
        event time appears twice, with x- and x+.
    events, modes, stats, status, success, message, warnings : object
        As in a `Solution`.

    Other Parameters
    ----------------
    model, run, grid, save, wall_time, compile_time : object
        Passed on by `simulate`; do not construct it by hand.

    Examples
    --------
    >>> import hybridsim as hs
    >>> sol = hs.simulate(hs.two_blocks_on_belt(), (0, 1))
    >>> sol.status, sol(1.0).shape
    ('finished', (4,))
    """

    integrator = "taylor"

    def __init__(
        self,
        model: MechanicalSystem,
        run: MechanicalRun,
        grid: np.ndarray | None,
        save: str,
        wall_time: float,
        compile_time: float,
    ) -> None:
        self.model, self._run, self._grid, self._save = model, run, grid, save
        self._cost = (wall_time, compile_time)
        n, place = model.n, np.argsort(run.built.dofs)
        self._columns = np.concatenate(
            [place, n + place]
        )  # in the order of the arrays, for each declared state
        event = np.concatenate([*run.events, np.zeros((0, 4), dtype=np.int64)])
        self._event = np.ascontiguousarray(event)
        self._when = instants(np.concatenate([*run.when, np.zeros((0, 3))]))
        self._contact_of = run.built.contacts

    # -- trajectory -----------------------------------------------------------------------------------------

    @cached_property
    def _segments(self) -> NodeSegments:
        self._require_states()
        return NodeSegments(self._run.built.arrays, self._run.segments or [self._run.start_segments()])

    @cached_property
    def _scratch(self) -> tuple[Any, Any]:
        built, order = self._run.built, self._run.order
        return new_state(built, order), new_scratch(built, order)

    @property
    def t_start(self) -> float:
        """First time of the run."""
        return self._run.span[0]

    @property
    def t_end(self) -> float:
        """Last time that the run reached."""
        return self._run.span[1] if self._run.code == DONE else self._run.time

    @cached_property
    def t(self) -> np.ndarray:
        """Times (k,): the requested grid, else the starts of series, with every event time twice."""
        if self._grid is not None:
            return self._grid[(self._grid >= self.t_start) & (self._grid <= self.t_end)]
        return np.sort(np.concatenate([self._starts, *([self._event_times] * 2), [self.t_end]]))

    @cached_property
    def _event_times(self) -> np.ndarray:
        return np.unique(self._when[self._when > self.t_start])

    @cached_property
    def _starts(self) -> np.ndarray:
        begins = np.unique(self._segments.begins)
        return begins[~np.isin(begins, self._event_times) & (begins < self.t_end)]

    @cached_property
    def y(self) -> np.ndarray:
        """States (2n, k) at the times t."""
        if self._grid is not None:
            return self(self.t)
        times, first = self.t, np.append(np.diff(self.t) == 0.0, False)
        out = self._states(times, True)
        out[first] = self._states(times[first], False)
        return out.T

    def __call__(self, t: Any, side: str = "+") -> np.ndarray:
        """Return the states at time t: (2n,) for a number, (2n, k) for k times; side "-" gives x- at an event."""
        if side not in ("+", "-"):
            raise UsageError(f"side is {side!r}", remedy="give '+' or '-'")
        x = self._states(self._within(t), side == "+")
        return x[0] if np.ndim(t) == 0 else x.T

    def _states(self, times: np.ndarray, right: bool) -> np.ndarray:
        out = self._segments.states(times, right)
        arrays = self._run.built.arrays
        if not arrays.unit.all():
            self._quantities(times, right, out)
        return out[:, self._columns]

    def _quantities(
        self, times: np.ndarray, right: bool, states: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return forces and relative velocities (k, m), at states that satisfy the stick constraints."""
        built, (state, scratch) = self._run.built, self._scratch
        forces, velocities = np.empty((2, len(times), len(self.model.contacts)))
        order = np.argsort(times, kind="stable")
        packs = (packed(built.arrays), packed(built.laws), packed(state), packed(scratch))
        reach_kernels(state, *packs)
        quantities(
            *packs, self._when, self._event,
            self._run.first_modes, times, order, right, states, forces, velocities,
        )  # fmt: skip
        return forces, velocities

    def output(self, name: str, t: Any = None, side: str = "+") -> np.ndarray:
        """Return a state, a friction force by its contact's name, or ``v_rel(f)``, the slip velocity, over time.

        Parameters
        ----------
        t : a number or an array of times; without it ``sol.t``.
        """
        requested, side = self.t if t is None else t, side_of_event(side)
        times = as_times(requested)
        name = known_name(
            name, [*self.names, *self.quantities], f"{self.model.name} has no quantity", "quantities"
        )
        if name in self.names:
            values = self(times, side)[self.names.index(name)]
        else:
            contacts = [c.name for c in self.model.contacts]
            own = name.removeprefix("v_rel(").removesuffix(")")
            right = side == "+"
            column = int(np.argsort(self._contact_of)[contacts.index(own)])
            both = self._quantities(times, right, self._segments.states(times, right))
            values = both[0 if own == name else 1][:, column]
        return values[0] if np.ndim(requested) == 0 else values

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of the quantities of `output` in addition to the states: friction forces and relative velocities."""
        contacts = [c.name for c in self.model.contacts]
        return (*contacts, *(f"v_rel({c})" for c in contacts))

    def _values(self, name: str, t: np.ndarray, right: bool) -> np.ndarray:
        return self.output(name, t, "+" if right else "-")

    # -- events and modes -----------------------------------------------------------------------------------

    @cached_property
    def events(self) -> Sequence[Event]:
        """All changes of mode in order of time; the states of an event are computed on demand."""
        self._require_events()
        return _Events(self)

    def event_times(self, component: str, kind: str | None = None) -> np.ndarray:
        """Return the times of the events of one contact."""
        self._asked(component, kind, [contact.name for contact in self.model.contacts])
        numbers = [i for i, c in enumerate(self.model.contacts) if c.name == component]
        chosen = np.isin(self._contact_of[self._event[:, 0]], numbers) & (kind in (None, "transition"))
        return self._when[chosen]

    @cached_property
    def modes(self) -> dict[str, tuple[ModeInterval, ...]]:
        """The modes of each contact in order, with the time interval of each."""
        self._require_events()
        found = ByName[tuple[ModeInterval, ...]]()
        place = np.argsort(self._contact_of)
        for i, contact in enumerate(self.model.contacts):
            mine = self._event[:, 0] == place[i]
            times = [self.t_start, *self._when[mine].tolist(), self.t_end]
            numbers = [int(self._run.first_modes[place[i]]), *self._event[mine, 2].tolist()]
            found[contact.name] = tuple(
                ModeInterval(_MODES[z], a, b) for z, a, b in zip(numbers, times[:-1], times[1:], strict=True)
            )
        return found

    # -- how it went ----------------------------------------------------------------------------------------

    @property
    def x_end(self) -> np.ndarray:
        """States (2n,) at the end of the run; they are available for every value of `save`."""
        run = self._run
        return run.state.x.reshape(-1)[self._columns].copy()

    @property
    def status(self) -> str:
        """How the run ended: "finished" at t1, else the reason it stopped."""
        return STATUS[self._run.code]

    @property
    def success(self) -> bool:
        """Whether the run reached its end."""
        return self._run.code == DONE

    @property
    def message(self) -> str:
        """One sentence about how the run ended."""
        code, t = self._run.code, self.t_end
        if code == DONE:
            return f"reached t = {t!r} with taylor, order {self._run.order}"
        if code == LIMITED:
            return f"stopped at t = {t!r}: {self._run.limit_message}"
        names = [self.model.contacts[i].name for i in self._run.node_contacts]
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
        """Warnings of the run: events that rounding leaves undecided, and near-grazings."""
        *_, undecided, touches = self._run.state.counts.tolist()
        texts = {
            f"undecided at rounding ({undecided} times)": undecided,
            f"near-grazing ({touches} times)": touches,
        }
        return tuple(text for text, count in texts.items() if count)

    @property
    def stats(self) -> dict[str, float]:
        """Cost: steps of the whole system, events, restarts of patches, restarted nodes, seconds."""
        steps, events, restarts, nodes, *_ = self._run.state.counts.tolist()
        return {
            "steps": steps, "events": events, "restarts": restarts, "nodes_restarted": nodes,
            "kernel_time": self._run.kernel_time, "wall_time": self._cost[0], "compile_time": self._cost[1],
        }  # fmt: skip

    def __repr__(self) -> str:
        stats = self.stats
        return "\n".join(
            [
                f"Solution of {self.model.name} by taylor: {self.status}",
                f"  {self.message}",
                f"  events: {stats['events']}",
                f"  cost: {stats['steps']} steps, {stats['restarts']} restarts of a part, {stats['wall_time']:.3g} s",
                *(f"  warning: {w}" for w in self.warnings),
            ]
        )


class _Events(Sequence[Event]):
    """The events of a solution, created on demand."""

    def __init__(self, solution: MechanicalSolution) -> None:
        self._solution = solution

    def __len__(self) -> int:
        return len(self._solution._when)

    @overload
    def __getitem__(self, i: int) -> Event: ...
    @overload
    def __getitem__(self, i: slice) -> list[Event]: ...
    def __getitem__(self, i: Any) -> Any:
        if isinstance(i, slice):
            return [self[k] for k in range(*i.indices(len(self)))]
        sol = self._solution
        c, source, target, guard = sol._event[i].tolist()
        t, name = float(sol._when[i]), sol.model.contacts[sol._contact_of[c]].name
        nothing = np.full(2 * sol.model.n, np.nan)
        has_states = sol._save == "all"
        x_minus, x_plus = (sol(t, "-"), sol(t)) if has_states else (nothing, nothing)
        modes = (_MODES[source], _MODES[target])
        return Event(t, "transition", name, _GUARDS[guard], *modes, -1, x_minus, x_plus)

    def __iter__(self) -> Iterator[Event]:
        return (self[i] for i in range(len(self)))
