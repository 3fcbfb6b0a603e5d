"""Leaps of the compiled mode loop as the general one sees them: segments and events in, the state after them out."""

from __future__ import annotations

import math

import numpy as np

from hybridsim.engine.crossings import Crossings
from hybridsim.engine.leap import AT_TARGET, FULL, Record, Room, State, leap
from hybridsim.engine.linear_tables import no_tables
from hybridsim.engine.mode_tables import automata_of, shelf_of
from hybridsim.engine.ordinary_event import functions_of, work_space
from hybridsim.engine.packs import packed
from hybridsim.engine.series import series_order
from hybridsim.engine.series_block import SeriesBlock
from hybridsim.engine.settle import Outcome
from hybridsim.engine.stepping import ARRIVED, BEFORE_SOMETHING, PAUSED, Landing, Tolerances
from hybridsim.engine.system import System
from hybridsim.engine.timepair import Instant
from hybridsim.engine.trajectory import Trajectory

_STEPS, _SEGMENTS = 4096, 1024  # room for one call
_ROOM, _FEWEST = (
    1 << 19,
    64,
)  # doubles for the series of one call, as far as that leaves room for so many steps
_FROM_NOTHING = np.zeros(1, dtype=np.int64)
_TIGHTEST = 1e-15
_NOT_LINEAR = no_tables()


_compiled: list[bool] = []


def compile_leaps(system: System) -> None:
    """Have ready what leaps call: functions of this system, and the loop itself, the same for all, once a process."""
    functions_of(system)
    if _compiled or not system.n:
        return
    leaper = Leaper(system, Tolerances(1e-3, np.full(system.n, 1e-3)), math.inf)
    nowhere, none = Instant(0.0), np.zeros(0, dtype=np.int64)
    guards, n = system.guard_count, system.n
    modes = np.zeros(len(system.automata), dtype=np.int64)
    p = system.vector(nowhere, np.zeros(system.layout.discrete))
    still = Outcome(
        np.zeros(n),
        p,
        modes,
        np.ones(guards, dtype=np.int64),
        np.zeros(guards, dtype=np.int64),
        none,
        none,
        np.zeros(n),
        np.zeros(guards),
        np.zeros(0),
    )
    leaper.leap(nowhere, still, p, nowhere, Trajectory(system))
    _compiled.append(True)


class Leaper:
    """Leaps of one run."""

    def __init__(self, system: System, tolerances: Tolerances, longest: float) -> None:
        self.system = system
        n, layout, guards = system.n, system.layout, system.guard_count
        rtol = max(tolerances.rtol, _TIGHTEST)
        order = series_order(rtol, system.is_linear)
        registers = system.registers
        self.shelf, self.automata = shelf_of(system), automata_of(system)
        self.functions = functions_of(system)
        self.inputs = registers.inputs
        self.places = (
            np.asarray(system.rates),
            layout.origin_at,
            layout.phases_at,
            layout.discrete_at,
            layout.discrete,
        )
        self.control = (rtol, tolerances.atol, order, tolerances.max_step, longest)
        self.work = work_space(system)
        count = len(system.automata)
        self.room = packed(
            Room(
                np.zeros((registers.count, order + 1)),
                np.zeros((registers.count, order + 1)),
                *(np.empty(order + 1) for _ in range(2)),
                np.empty((64, order + 1)),
                *(np.empty(n) for _ in range(3)),
                np.empty(count, dtype=np.int64),
                np.empty(layout.size),
                *(np.empty(n) for _ in range(2)),
                np.empty(guards, dtype=np.int64),
                np.empty(guards, dtype=np.int64),
                np.empty(guards),
            )
        )
        self.order = order
        self._renew()

    def _renew(self) -> None:
        """Fresh arrays to write to; blocks that were committed go on using the former ones."""
        n, count = self.system.n, len(self.system.automata)
        steps = min(max(_ROOM // (n * (self.order + 1)), _FEWEST), _STEPS)
        self.used = (0, 0)  # steps and segments
        self.record = (
            np.empty((steps, 2)),
            np.empty((steps, n, self.order + 1)),
            np.empty(_SEGMENTS, dtype=np.int64),
            np.empty((_SEGMENTS, 2)),
            np.empty((_SEGMENTS, count), dtype=np.int64),
            np.empty((_SEGMENTS, self.system.layout.size)),
            np.empty(_SEGMENTS, dtype=np.int64),
            np.empty((_SEGMENTS, 2, n)),
        )

    def leap(
        self, origin: Instant, outcome: Outcome, p: np.ndarray, target: Instant, record: Trajectory
    ) -> Landing:
        """As far as ordinary events and the room for them go."""
        self.shelf.surround(outcome.z)
        clock, to = np.array([origin.high, origin.low]), np.array([target.high, target.low])
        state = State(
            outcome.x.copy(),
            outcome.x_error.copy(),
            outcome.z.copy(),
            p.copy(),
            outcome.sides.copy(),
            outcome.orders.copy(),
            outcome.guard_floors.copy(),
        )
        instants = []
        while True:
            rows = Record(*(part[u:] for part, u in zip(self.record, self._offsets(), strict=True)))
            code, steps, count = leap(
                self.functions, self.automata, self.shelf.tapes, self.inputs, _NOT_LINEAR, self.places, self.control,
                to, clock, packed(state), self.work, self.room, packed(rows),
            )  # fmt: skip
            instants.append(self._commit(rows, steps, count, state[2], clock, record))
            is_full = code == FULL and (count > 0 or self.used != (0, 0))
            if is_full:
                self._renew()
            known = len(self.shelf.tapes.modes)
            self.shelf.surround(state[2])
            if is_full or len(self.shelf.tapes.modes) == known:
                break
        x, x_error, z, p, sides, orders, floors = state
        none = np.zeros(0, dtype=np.int64)
        after = Outcome(x, p, z, sides, orders, none, none, x_error, floors, np.zeros(0), continuous=False)
        reached = Instant(*clock.tolist())
        end = PAUSED if is_full else (ARRIVED if code == AT_TARGET else BEFORE_SOMETHING)
        return Landing(reached, after, end, instants[0] if len(instants) == 1 else np.concatenate(instants))

    def _offsets(self) -> tuple[int, ...]:
        """Where the next call writes, in each array of the record."""
        steps, segments = self.used
        return (steps, steps, *(segments for _ in self.record[2:]))

    def _commit(
        self,
        rows: tuple[np.ndarray, ...],
        steps: int,
        count: int,
        z_after: np.ndarray,
        clock: np.ndarray,
        record: Trajectory,
    ) -> np.ndarray:
        """Leave the used part of the record to the trajectory; the instants (E, 2) of its events."""
        if not count:
            return np.empty((0, 2))
        lengths, series, ends, origins, modes, vectors, fired, jumps = (
            part[: steps if k < 2 else count] for k, part in enumerate(rows)
        )
        self.used = (self.used[0] + steps, self.used[1] + count)
        starts = np.concatenate([_FROM_NOTHING, ends])
        system, counters = self.system, record.counters
        record.segments.add(SeriesBlock(system, starts, lengths, series, origins, modes, vectors, jumps))
        counters.steps += steps
        counters.rhs_evaluations += 2 * steps  # one series a step, and the check at its end
        counters.restarts += count
        events = count if fired[-1] >= 0 else count - 1
        instants = np.concatenate([origins[1:], clock[None]])[:events]
        if events:
            after = np.concatenate([modes[1:], z_after[None]])[:events]
            crossings = Crossings(system, instants, fired[:events], modes[:events], after, jumps[:events])
            counters.events += len(crossings)
            record.occurrences.add(crossings)
        return instants
