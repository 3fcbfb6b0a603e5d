"""Leaps of the compiled mode loop as the general one sees them: segments and events in, the state after them out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hybridsim.engine.leap import AT_TARGET, FULL, leap
from hybridsim.engine.mode_tables import TapeShelf, automata_of
from hybridsim.engine.ordinary_event import functions_of, work_space
from hybridsim.engine.series import series_order
from hybridsim.engine.settle import Outcome
from hybridsim.engine.stepping import Tolerances
from hybridsim.engine.system import System
from hybridsim.engine.taylor import polynomials
from hybridsim.engine.timepair import Instant
from hybridsim.engine.trajectory import Occurrence, Segment, Trajectory

_STEPS, _SEGMENTS = 4096, 1024  # room for one call
_TIGHTEST = 1e-15


@dataclass(frozen=True)
class SeriesPieces:
    """Dense output made of one Taylor series for each step: knots (m + 1,), coefficients (m, n, order + 1)."""

    knots: np.ndarray
    coefficients: np.ndarray

    def __call__(self, s: np.ndarray) -> np.ndarray:
        """States (k, n) at local times (k,)."""
        s = np.asarray(s, dtype=float)
        index = np.searchsorted(self.knots[1:-1], s, side="right")
        out = np.empty((len(s), self.coefficients.shape[1]))
        for i in np.unique(index):
            chosen = np.flatnonzero(index == i)
            part = np.empty((len(chosen), out.shape[1]))
            polynomials(self.coefficients[i], s[chosen] - self.knots[i], part)
            out[chosen] = part
        return out


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
    leaper.leap(nowhere, still, p, nowhere, Trajectory())
    _compiled.append(True)


class Leaper:
    """Leaps of one run."""

    def __init__(self, system: System, tolerances: Tolerances, longest: float) -> None:
        self.system = system
        n, layout, guards = system.n, system.layout, system.guard_count
        rtol = max(tolerances.rtol, _TIGHTEST)
        order = series_order(rtol, system.is_linear)
        registers = system.registers
        self.shelf = TapeShelf(system)
        self.functions, self.automata = functions_of(system), automata_of(system)
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
        self.room = (
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
        self.record = (
            np.empty((_STEPS, 2)),
            np.empty((_STEPS, n, order + 1)),
            np.empty(_SEGMENTS, dtype=np.int64),
            np.empty((_SEGMENTS, 2)),
            np.empty((_SEGMENTS, count), dtype=np.int64),
            np.empty((_SEGMENTS, layout.size)),
            np.empty(_SEGMENTS, dtype=np.int64),
            np.empty((_SEGMENTS, 2, n)),
        )

    def leap(
        self, origin: Instant, outcome: Outcome, p: np.ndarray, target: Instant, record: Trajectory
    ) -> tuple[Instant, Outcome, bool]:
        """As far as ordinary events go: the new origin, the state there, and whether it is the target."""
        self.shelf.add(outcome.z)
        self._shelve_neighbours(outcome.z)
        clock, to = np.array([origin.high, origin.low]), np.array([target.high, target.low])
        state = (
            outcome.x.copy(),
            outcome.x_error.copy(),
            outcome.z.copy(),
            p.copy(),
            outcome.sides.copy(),
            outcome.orders.copy(),
            outcome.guard_floors.copy(),
        )
        while True:
            code, _, count = leap(
                self.functions, self.automata, self.shelf.tapes, self.inputs, self.places, self.control,
                to, clock, state, self.work, self.room, self.record,
            )  # fmt: skip
            self._commit(count, state[2], clock, record)
            known = len(self.shelf.tapes.modes)
            self._shelve_neighbours(state[2])
            if not (code == FULL and count) and len(self.shelf.tapes.modes) == known:
                break
        x, x_error, z, p, sides, orders, floors = state
        none = np.zeros(0, dtype=np.int64)
        after = Outcome(x, p, z, sides, orders, none, none, x_error, floors, np.zeros(0), continuous=False)
        return Instant(float(clock[0]), float(clock[1])), after, code == AT_TARGET

    def _shelve_neighbours(self, z: np.ndarray) -> None:
        """Put the modes that one event may lead to on the shelf."""
        for c, automaton in enumerate(self.system.automata):
            for m in range(len(automaton.modes)):
                other = z.copy()
                other[c] = m
                self.shelf.add(other)

    def _commit(self, count: int, z_after: np.ndarray, clock: np.ndarray, record: Trajectory) -> None:
        _, _, ends, clocks, modes, _, fires, jumps = self.record
        first = 0
        for i in range(count):
            last = int(ends[i])
            record.segments.append(self._segment(i, first, last))
            record.counters.steps += last - first
            record.counters.rhs_evaluations += 2 * (
                last - first
            )  # one series a step, and the check at its end
            record.counters.restarts += 1
            first = last
            if fires[i] < 0:
                continue
            after = modes[i + 1] if i + 1 < count else z_after
            at = Instant(*map(float, clocks[i + 1])) if i + 1 < count else Instant(*map(float, clock))
            self._occur(int(fires[i]), modes[i], after, at, jumps[i], record)

    def _segment(self, i: int, first: int, last: int) -> Segment:
        steps, series, _, clocks, modes, vectors, _, jumps = self.record
        knots = np.append(steps[first:last, 0], steps[last - 1, 0] + steps[last - 1, 1])
        coefficients = series[first:last].copy()
        states = np.concatenate([coefficients[:, :, 0], jumps[i, :1]])
        p, z = vectors[i].copy(), modes[i].copy()
        if self.system.pins:
            states = self.system.rows("project", self.system.n, knots, states, p, z)
        return Segment(
            Instant(*map(float, clocks[i])), z, p, knots, states, SeriesPieces(knots, coefficients)
        )

    def _occur(
        self,
        fired: int,
        before: np.ndarray,
        after: np.ndarray,
        at: Instant,
        x: np.ndarray,
        record: Trajectory,
    ) -> None:
        system = self.system
        owner = int(system.owner[fired])
        for c, automaton in enumerate(system.automata):
            if before[c] == after[c] and not (c == owner and not automaton.has_surface):
                continue
            place = automaton.guards[before[c]].index(fired) if c == owner else -1
            record.occurrences.append(
                Occurrence(
                    at,
                    "transition",
                    automaton.name,
                    automaton.guard_names[before[c]][place] if c == owner else "",
                    automaton.modes[before[c]],
                    automaton.modes[after[c]],
                    -1,
                    x[0].copy(),
                    x[1].copy(),
                )
            )
            record.counters.events += 1
