"""Prepare the known times ahead of a run as arrays for compiled loops: knots of inputs, and clock ticks.

The rules are those of `hybridsim.engine.system.timetable`. Times whose order or coincidence depends on rounding, and
schedules that end the run or change states, are left to the general loop: the known times end before them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hybridsim.engine.series.optimise import PAIRED, arguments_of
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.per_structure import per_structure
from hybridsim.engine.system.system import System

if TYPE_CHECKING:
    from hybridsim.engine.system.timetable import Appointment, Timetable

MAX_KNOWN_TIMES = 512  # known times of one block: enough that making the block costs little beside them
MAX_KINDS = 32  # combinations of schedules that are due at one time
START = 4  # index of a piece's start among its numbers
_RATIO = 4.0  # of the lengths of pieces that belong to different orders of magnitude
_APART = 0.1  # exponent that puts common lengths, as 1 or 1/4, away from the limits of the orders
_CLEAR = 4.0  # times farther apart than this many roundings of a time are certainly two, and nearer than one are one


class KnownTimes(NamedTuple):
    """Known times after an instant, in order, up to the `target`.

    Parameters
    ----------
    instants : (m, 2), high and low.
    kinds : (m,), indices of the schedules that are due, see `TimesAhead.due`.
    polynomials : (m + 1, S, 6), the pieces of the inputs up to each of the times, and after the last one: four
        coefficients and the start.
    lengths : (m + 1,), the order of magnitude of the shortest piece up to each of the times, and after the last one;
        infinite if all inputs are constant there.
    due : the schedules of each kind.
    is_part : whether the target is the last of these times, and the run goes on from there.
    target, appointment : the next known time after these, or the end of the run and None.
    """

    instants: np.ndarray
    kinds: np.ndarray
    polynomials: np.ndarray
    lengths: np.ndarray
    due: list[tuple[int, ...]]
    target: Instant
    appointment: Appointment | None
    is_part: bool = False

    @property
    def first(self) -> Instant:
        """Return the first known time, or the target if there is no known time."""
        return self.instant(0) if len(self.kinds) else self.target

    def instant(self, i: int) -> Instant:
        """Return the known time at a given position in the list."""
        return Instant(*self.instants[i].tolist())

    def up_to(self, target: Instant) -> KnownTimes:
        """Return the known times before a new target."""
        if target == self.target:
            return self
        m = int(np.count_nonzero(_minus(self.instants, np.array([target])) < 0.0))
        return self._replace(
            instants=self.instants[:m],
            kinds=self.kinds[:m],
            polynomials=self.polynomials[: m + 1],
            lengths=self.lengths[: m + 1],
            target=target,
        )

    def of_like_lengths(self) -> KnownTimes:
        """Return the known times as long as the input intervals have lengths of one order of magnitude."""
        m = int(np.argmax(self.lengths != self.lengths[0]))
        if m == 0:
            return self
        return self._replace(
            instants=self.instants[:m],
            kinds=self.kinds[:m],
            polynomials=self.polynomials[: m + 1],
            lengths=self.lengths[:m],
            target=self.instant(m - 1),
            appointment=None,
            is_part=True,
        )

    def since(self, first: int) -> KnownTimes:
        """Return the known times, starting with the time of a given number."""
        return self._replace(
            instants=self.instants[first:],
            kinds=self.kinds[first:],
            polynomials=self.polynomials[first:],
            lengths=self.lengths[first:],
        )


class TimesAhead:
    """The known times of one run forward in time, which compiled loops process without Python.

    due: the schedules of each kind of known time. resets (MAX_KINDS, width): the numbers of their resets, ended by -1.
    """

    def __init__(self, system: System, timetable: Timetable, end: Instant) -> None:
        self.system, self.timetable, self.end = system, timetable, end
        self.due: list[tuple[int, ...]] = [()]
        self._kinds: dict[tuple[int, ...], int] = {(): 0}
        width = len(system.model.schedules) + 1
        self.resets = np.full((MAX_KINDS, width), -1, dtype=np.int64)
        reads_inputs, reads_discrete = what_surfaces_read(system)
        self._are_inputs_simple = not reads_inputs
        self._simple = [not reads_discrete and self._is_simple(k) for k in range(len(system.model.schedules))]
        self._block: KnownTimes | None = None
        self._passed = 0  # number of times in the block up to the present instant

    def _is_simple(self, k: int) -> bool:
        """Return whether a schedule neither ends the run nor changes states; it may change discrete states."""
        system, key = self.system, ("schedule", k)
        if system.model.schedules[k].terminate:
            return False
        return not set(system.resets.get(key, (0, ()))[1]) & set(system.names)

    def after(self, origin: Instant) -> KnownTimes:
        """Return the known times after an instant; calls must follow each other in order of time."""
        block = self._block
        if block is not None:
            ahead = _minus(block.instants[self._passed :], np.array([origin])) > 0.0
            self._passed += int(np.count_nonzero(~ahead))
            if self._passed < len(block.kinds) or block.target.minus(origin) > 0.0:
                return block.since(self._passed)
        self._block, self._passed = self._made(origin), 0
        return self._block

    def kind_of(self, due: tuple[int, ...]) -> int | None:
        """Return the kind of a known time at which some schedules are due, or None if a schedule is not simple."""
        if due in self._kinds:
            return self._kinds[due]
        targets: list[str] = []
        numbers: list[int] = []
        for k in due:
            if not self._simple[k]:
                return None
            if ("schedule", k) in self.system.resets:
                number, names = self.system.resets["schedule", k]
                numbers.append(number)
                targets += names
        if len(self.due) == MAX_KINDS or len(set(targets)) < len(targets):
            return None
        kind = self._kinds[due] = len(self.due)
        self.resets[kind, : len(numbers)] = numbers
        self.due.append(due)
        return kind

    def _made(self, origin: Instant) -> KnownTimes:
        """Return a block of known times after an instant."""
        signals = self.system.signals
        ahead = [signal.ahead(origin, MAX_KNOWN_TIMES) for signal in signals]
        found = [(knots, -1 - i) for i, (knots, _) in enumerate(ahead)]
        found += [(self.timetable.ahead(k, origin, MAX_KNOWN_TIMES), k) for k in range(len(self._simple))]
        times = np.concatenate([np.empty((0, 2)), *(knots for knots, _ in found)])
        sources = np.repeat([source for _, source in found], [len(knots) for knots, _ in found])
        order = np.lexsort((times[:, 1], times[:, 0]))
        times, sources = times[order], np.asarray(sources, dtype=np.int64)[order]
        slack = self.timetable.slacks(times[:, 0])
        limits = [self.end] + [
            Instant(*knots[-1].tolist()) for knots, _ in found if len(knots) == MAX_KNOWN_TIMES
        ]
        is_new = _minus(times[1:], times[:-1]) > _CLEAR * slack[1:]
        first = np.concatenate([[0], np.flatnonzero(is_new) + 1])[: len(times)]
        last = np.concatenate([first[1:], [len(times)]])[: len(first)] - 1
        is_clear = _minus(times[last], times[first]) <= slack[first]
        for limit in limits:
            is_clear &= _minus(np.array([limit]), times[last]) > _CLEAR * slack[last]
        if len(first):
            is_clear[0] &= _minus(times[:1], np.array([origin]))[0] > _CLEAR * slack[0]
        kinds: list[int] = []
        for g in range(len(first) if is_clear.all() else int(np.argmin(is_clear))):
            members = sources[first[g] : last[g] + 1].tolist()
            kind = self._kind_at(members)
            if kind is None or len(kinds) == MAX_KNOWN_TIMES:
                break
            kinds.append(kind)
        m = len(kinds)
        instants = times[last[:m]]
        polynomials, lengths = np.empty((m + 1, len(signals), 6)), np.full(m + 1, np.inf)
        for i, (knots, rows) in enumerate(ahead):
            numbers = np.concatenate([[0], np.cumsum(sources == -1 - i)[last[:m]]])
            polynomials[:, i] = rows[numbers]
            lengths = np.minimum(lengths, _lengths(knots, rows)[numbers])
        until = Instant(*instants[-1].tolist()) if m else origin
        appointment = self.timetable.next(until, True)
        target = appointment.instant if appointment else self.end
        return KnownTimes(
            instants, np.array(kinds, dtype=np.int64), polynomials, lengths, self.due, target, appointment
        )

    def _kind_at(self, members: list[int]) -> int | None:
        """Return the kind of a known time, from the schedules and inputs that belong to it."""
        if len(members) > 1:
            members.sort()
        if members[0] < 0 and not self._are_inputs_simple:
            return None
        return self.kind_of(tuple(k for k in members if k >= 0))


@per_structure
def what_surfaces_read(system: System) -> tuple[bool, bool]:
    """Return whether any surface reads an input, and whether any surface reads a discrete state."""
    tape, layout, found = system.code.data["tape"], system.layout, []
    for sources in (range(layout.signals_at, layout.size), range(layout.discrete_at, layout.origin_at)):
        reading = {r for r, source in tape["parameters"] if source in sources}
        for _, branches in tape["parts"]:
            for row in (row for branch in branches for row in branch):
                if reading.intersection(arguments_of(row)):
                    reading |= {row[4], row[4] + 1} if row[0] in PAIRED else {row[4]}
        found.append(bool(reading.intersection(tape["surfaces"])))
    return found[0], found[1]


def _lengths(knots: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return the length of each interval of an input, rounded to a power of a fixed ratio; infinity if constant."""
    found = np.full(len(rows), np.inf)
    varying = np.flatnonzero(rows[: len(knots), 1:START].any(axis=1))
    length = _minus(knots[varying], rows[varying, START:])
    found[varying] = _RATIO ** np.ceil(np.log2(length) / np.log2(_RATIO) - _APART)
    return found


def _minus(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the differences of instants (k, 2) as doubles."""
    return np.asarray((a[:, 0] - b[:, 0]) + (a[:, 1] - b[:, 1]))
