"""Many runs of one model that differ in the values of parameters and in their start: the last period of each.

A single run has its model checked, bound and decided on at its start in Python, which takes several times as long as a
short run of linear modes itself. Here that is done for all runs together, or in compiled code. The runs are those of
`hybridsim.engine.exact_leaper`; one that holds anything unusual is left to it.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.desk import Desk
from hybridsim.engine.event_work import MOST, functions_of, work_space
from hybridsim.engine.exact_leap import Record, Room, exact_leap
from hybridsim.engine.fleet_start import opposing, plain_start, rests_for_ever
from hybridsim.engine.fleet_tables import fleet_tables
from hybridsim.engine.jit import ENABLED, Door
from hybridsim.engine.leap import AT_TARGET, FULL
from hybridsim.engine.leaper import NOT_LINEAR
from hybridsim.engine.linear_guards import TERMS
from hybridsim.engine.linear_modes import holds_constants, is_always_linear
from hybridsim.engine.mode_tables import automata_of, shelf_of
from hybridsim.engine.outcome import Outcome
from hybridsim.engine.packs import packed
from hybridsim.engine.period import common_multiple
from hybridsim.engine.segment_end import reach_settling
from hybridsim.engine.stretch import NODES, WEIGHTS, Stretch, sum_up
from hybridsim.engine.system import System
from hybridsim.engine.timepair import Instant

_SEGMENTS = 1024  # room for one call of the loop
_TOGETHER = 128  # runs whose tables are made at once: they stay in the processor's cache
# Where events follow each other ever faster the loop ends, for others to see whether they accumulate. A few intervals
# that shrink by one factor are none of that yet: it goes on, so often at most.
_RESUMED = 4
_TURNS = 100  # as in `hybridsim.engine.loop`: the longest segment, in turns of the fastest angle
_FULLY = 2.0 * math.pi

_leap, _start, _rests, _sum_up = Door(exact_leap), Door(plain_start), Door(rests_for_ever), Door(sum_up)
_opposing = Door(opposing)


class Last(NamedTuple):
    """The last period of one run: how long it is, and what the states did."""

    period: float
    stretch: Stretch


def sails(system: System) -> bool:
    """Whether runs of a model may go together: contacts alone, in modes that are linear at any values of parameters.

    What they hold has to be a number: what a state does that follows others is not read off here.
    """
    model = system.model
    parts = model.monitors or model.inputs or model.schedules or model.discrete or system.ties
    return (
        ENABLED
        and system.has_tape
        and system.n > 0
        and not parts
        and all(a.has_surface and not (a.is_unique or a.is_unilateral) for a in system.automata)
        and len(system.automata) <= MOST  # the shelf is complete from the beginning
        and is_always_linear(system)
        and holds_constants(system)
    )


class Fleet:
    """Runs of one system from t = 0, each over a number of periods of its forcing; for one thread.

    Parameters
    ----------
    system : one for which `sails` holds, at any values of its parameters.
    goes_on : asked now and then in long runs, which end where it says no.
    """

    def __init__(self, system: System, goes_on: Callable[[], bool]) -> None:
        self.system, self.automata, self.goes_on = system, automata_of(system), goes_on
        self.functions, self.inputs = functions_of(system), system.registers.inputs
        self.first = np.zeros(len(system.automata), dtype=np.int64)
        shelf = shelf_of(system)
        shelf.surround(self.first)
        self.tapes = shelf.tapes
        lean = system.lean_tape(self.first)
        self.surfaces = (
            lean.constant_rows,
            lean.rows,
            lean.derivatives,
            lean.surfaces,
            np.array(system.surface_of, dtype=np.int64),
        )
        self.hold = np.array([a.hold for a in system.automata], dtype=np.int64)

    def runs(
        self, parameters: np.ndarray, starts: np.ndarray, periods: int
    ) -> Iterator[tuple[int, Last | None]]:
        """The last period of each run, by its number, in any order; None where a run is not for a fleet.

        What a period holds is to be read before the next one is asked for. parameters (N, P), in the order of the
        model; starts (N, n).
        """
        for first in range(0, len(parameters), _TOGETHER):
            here = slice(first, first + _TOGETHER)
            for i, last in self._runs(parameters[here], starts[here], periods):
                yield first + i, last

    def _runs(
        self, parameters: np.ndarray, starts: np.ndarray, periods: int
    ) -> Iterator[tuple[int, Last | None]]:
        system, layout = self.system, self.system.layout
        vectors = np.zeros((len(parameters), layout.size))
        vectors[:, : layout.parameters] = parameters
        vectors[:, layout.pin_at] = 1.0
        rates = np.array([system.rates_at(p) for p in vectors]).reshape(len(vectors), -1)
        times = np.array(
            [common_multiple((_FULLY / abs(row[row != 0.0])).tolist()) or math.nan for row in rates]
        )
        fastest = np.abs(rates).max(axis=1, initial=0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            longest = _TURNS * _FULLY / fastest
            horizons = np.minimum(periods * times, longest)
        fit = np.flatnonzero(np.isfinite(times) & self._may_begin(starts, vectors))
        left = set(range(len(vectors)))
        groups = fleet_tables(system, self.tapes.modes, np.ascontiguousarray(parameters[fit]), horizons[fit])
        for group in groups:
            spare: deque[Any] = system.code.shared(f"scratch of fleets for {group.form}", deque)
            try:
                ship = spare.pop()
            except IndexError:
                ship = _Ship(self, group.at(0), vectors[0])
            for k, i in enumerate(fit[group.numbers].tolist()):
                period = float(times[i])
                stretch = ship.run(
                    self,
                    group.at(k),
                    vectors[i],
                    rates[i],
                    starts[i],
                    periods * period,
                    period,
                    float(longest[i]),
                )
                left.discard(i)
                yield i, None if stretch is None else Last(period, stretch)
            spare.append(ship)
        for i in sorted(left):
            yield i, None

    def _may_begin(self, starts: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        """Where each contact opposes its own velocity (N,); a run with one that does not is refused by itself."""
        found = np.empty(len(starts), dtype=np.bool_)
        room = np.zeros(len(self.system.surface_of))
        _opposing(self.system.address("effects"), starts, vectors, self.first, room, found)
        return found


class _Ship:
    """Scratch arrays for runs whose tables are of one form."""

    def __init__(self, fleet: Fleet, tables: Any, p: np.ndarray) -> None:
        system = fleet.system
        n, guards, widest, count = system.n, system.guard_count, tables.values.shape[1], len(system.automata)
        whole = np.int64
        room = Room(
            c=np.zeros(widest, dtype=complex),
            v=np.zeros(widest, dtype=complex),
            terms=np.zeros((2, TERMS)),
            starts=np.zeros((guards, TERMS + 2)),
            hints=np.zeros(tables.farthest.shape),
            scale=np.empty(n),
            pace=np.empty(3),
        )
        work = work_space(system, len(tables.kinds), len(tables.factor_start) - 1)
        none = np.zeros(0, dtype=whole)
        blank = Outcome(
            np.zeros(n), p.copy(), np.zeros(count, dtype=whole), np.ones(guards, dtype=whole),
            np.zeros(guards, dtype=whole), none, none, np.zeros(n), np.zeros(guards), np.zeros(0),
        )  # fmt: skip
        self.desk = Desk.of(blank, p, work, packed(room))
        self.c = room.c
        reach_settling(fleet.automata, fleet.tapes, fleet.inputs, tables, self.desk.as_packed, self.desk.work)
        self.records = [
            Record(
                ends=np.empty(_SEGMENTS),
                clocks=np.empty((_SEGMENTS + 1, 2)),
                rows=np.empty(_SEGMENTS, dtype=whole),
                modes=np.empty((_SEGMENTS + 1, count), dtype=whole),
                vectors=np.empty((_SEGMENTS, system.layout.size)),
                coordinates=np.empty((_SEGMENTS, widest), dtype=complex),
                fires=np.empty(_SEGMENTS, dtype=whole),
                jumps=np.empty((_SEGMENTS, 3, n)),
            )
            for _ in range(2)
        ]
        self.packs = [packed(record) for record in self.records]
        self.room = (np.zeros(widest, dtype=complex), np.zeros((3, n)))
        self.found = Stretch(
            extremes=np.empty((2, n)),
            integrals=np.empty((2, n)),
            ends=np.empty((2, n)),
            held=np.empty((2, count)),
            holding=np.empty((2, count), dtype=np.bool_),
        )
        self.found_packed = packed(self.found)

    def run(
        self, fleet: Fleet, tables: Any, p: np.ndarray, rates: np.ndarray, x0: np.ndarray, end: float, period: float,
        longest: float,
    ) -> Stretch | None:  # fmt: skip
        """The last period of one run from 0 to `end`; None where it meets something unusual."""
        layout, desk, tapes = fleet.system.layout, self.desk, fleet.tapes
        state = desk.state
        state.x[:], state.p[:] = x0, p
        places = (rates, layout.origin_at, layout.phases_at)
        if not _start(
            fleet.functions, fleet.automata, tapes, fleet.inputs, NOT_LINEAR, (*places, layout.pin_at), fleet.surfaces,
            0.0, desk.as_packed, desk.work,
        ):  # fmt: skip
            return None
        if _rests(tapes, tables, desk.as_packed, desk.work, self.c):
            return self._at_rest(fleet, period)
        clock, target = np.zeros(2), np.array([end, 0.0])
        since, kept, resumed = Instant(end - period), 0, 0
        while resumed <= _RESUMED:
            code, count = _leap(
                fleet.functions, fleet.automata, tapes, fleet.inputs, tables, places, longest, target, clock,
                desk.as_packed, desk.work, desk.room, self.packs[0],
            )  # fmt: skip
            if code == AT_TARGET:
                return self._measured(fleet, tables, since, kept, count)
            if not count or not fleet.goes_on():
                return None
            resumed += code != FULL
            self.records.reverse()
            self.packs.reverse()
            kept = count
        return None

    def _blank(self) -> Stretch:
        found = self.found
        found.extremes[0], found.extremes[1] = np.inf, -np.inf
        found.integrals[:] = found.held[:] = 0.0
        return found

    def _at_rest(self, fleet: Fleet, period: float) -> Stretch:
        found, state = self._blank(), self.desk.state
        for part in (found.extremes, found.ends):
            part[:] = state.x
        found.integrals[:] = period * state.x, period * state.x**2
        held = state.z == fleet.hold
        found.held[:], found.holding[:] = (period * held, held), held
        return found

    def _measured(self, fleet: Fleet, tables: Any, since: Instant, kept: int, count: int) -> Stretch | None:
        """What the segments say that hold all after an instant, of those kept before and those just recorded."""
        record, first = self.records[0], 0
        if kept and float(since) < record.clocks[0, 0]:  # it is among the former ones
            record = Record(
                *(np.concatenate([a[:kept], b[:count]]) for a, b in zip(self.records[1], record, strict=True))
            )
            count += kept
        clocks = record.clocks[:count]
        behind = (clocks[:, 0] - since.high) + (clocks[:, 1] - since.low)
        first = max(int(np.searchsorted(behind, 0.0, side="right")) - 1, 0)
        begin = since.minus(Instant(*clocks[first].tolist()))
        if begin < 0.0:
            return None  # more than there is room for in one period
        found = self._blank()
        done = _sum_up(
            tables, fleet.hold, (record.ends, record.rows, record.modes, record.coordinates, record.jumps),
            first, count, begin, NODES, WEIGHTS, self.room, self.found_packed,
        )  # fmt: skip
        return found if done else None
