"""What the mode loop asks of an integrator: a flow goes in, steps with dense output come out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from hybridsim.engine.native.rows import evaluate, evaluate_rows
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.segments import Dense
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tolerances import Tolerances

if TYPE_CHECKING:
    from hybridsim.engine.events.outcome import Outcome
    from hybridsim.engine.record.blocks import SegmentBlock
    from hybridsim.engine.record.trajectory import Trajectory
    from hybridsim.engine.run.desk import Laid
    from hybridsim.engine.run.kernel_run import Leapt
    from hybridsim.engine.system.instant import Instant


@dataclass(frozen=True)
class Root:
    """A zero that an integrator located by itself: of guard `number`, or of a monitor, falling (-1) or rising (+1)."""

    number: int
    direction: int
    is_monitor: bool = False


@dataclass(frozen=True)
class Step:
    """One accepted step from s0 to s1 (local times) with its dense output.

    roots is None where the mode loop locates events itself; else the zeros at s1 that the integrator found.
    holds, of a method that tests its dense output at the end of a step alone, tests it at a time inside, too.
    """

    s0: float
    s1: float
    x0: np.ndarray
    x1: np.ndarray
    dense: Dense
    roots: tuple[Root, ...] | None = None
    holds: Callable[[float], bool] | None = None


@dataclass(frozen=True)
class Watch:
    """What to look for in one segment: active guards and all monitors, with side and leading order at its start.

    guards are the numbers of the active guards; the other arrays are over all guards, and over all monitors. x_error
    is how well the states are known at the start, the floors what that makes of the guards that start from zero.
    """

    guards: np.ndarray
    sides: np.ndarray
    orders: np.ndarray
    monitor_sides: np.ndarray
    monitor_orders: np.ndarray
    x_error: np.ndarray
    guard_floors: np.ndarray
    monitor_floors: np.ndarray


@dataclass
class Flow:
    """The smooth field of one segment, as integrators see it: rhs(s, x), counted.

    look: told the local time by a method that does a whole segment in one call; raises where the run has to end.
    """

    system: System
    p: np.ndarray
    z: np.ndarray
    counters: Counters
    forward: bool = True
    look: Callable[[float], None] | None = None

    def __post_init__(self) -> None:
        system = self.system
        self.n = system.n
        self._flow = system.address("flow")
        holding = (c for c in system.projected if self.z[c] == system.automata[c].hold)
        self._projected = sorted({i for c in holding for i in system.projected[c]})

    def rhs(self, s: float, x: np.ndarray) -> np.ndarray:
        """dx/dt in a fresh array; NaN where the model has no value."""
        out = np.empty(self.n)
        evaluate(self._flow, float(s), x, self.p, self.z, out)
        return out

    def jacobian(self, s: float, x: np.ndarray) -> np.ndarray:
        """d(dx/dt)/dx, (n, n), as it is differentiated from the declaration; of Python functions by differences."""
        if not self.system.has_tape:
            return self.system.jacobian(float(s), np.ascontiguousarray(x, dtype=float), self.p, self.z)
        tangent, columns, both = (
            self.system.address("tangent"),
            np.empty((self.n, self.n)),
            np.zeros(2 * self.n),
        )
        both[: self.n] = x
        for k in range(self.n):
            both[self.n :] = 0.0
            both[self.n + k] = 1.0
            evaluate(tangent, float(s), both, self.p, self.z, columns[k])
        return columns.T

    def project(self, s: np.ndarray, x: np.ndarray) -> np.ndarray:
        """States (k, n) at local times (k,) with held states on their constraints."""
        x = np.ascontiguousarray(x, dtype=float)
        return self.system.rows("project", self.n, s, x, self.p, self.z) if self.system.can_hold else x

    def landed(self, s: float, x: np.ndarray) -> np.ndarray:
        """The end of a step, with states that a projection keeps on a surface put back onto it."""
        if not self._projected:
            return x
        held = x.copy()
        held[self._projected] = self.project(np.array([s]), x[None, :])[0, self._projected]
        return held

    def guards(self, s: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Guard values (k, guards); held states are evaluated from their constraints on the way."""
        self.counters.guard_evaluations += len(s)
        out = np.empty((len(s), self.system.guard_count))
        evaluate_rows(
            self.system.address("guards"), s, np.ascontiguousarray(x, dtype=float), self.p, self.z, out
        )
        return out

    def monitors(self, s: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Monitor values (k, monitors), likewise."""
        out = np.empty((len(s), len(self.system.monitor_names)))
        evaluate_rows(
            self.system.address("monitors"), s, np.ascontiguousarray(x, dtype=float), self.p, self.z, out
        )
        return out


class Stepper(Protocol):
    """An integration in progress through one smooth segment."""

    def step(self) -> Step:
        """The next accepted step; raises StepFailure."""

    def restep(self, step: Step, s: float) -> Step:
        """The step anew from its start to s exactly: the method's own accuracy at an event time.

        Where its error there is not within the tolerance, a shorter step, from whose end the next one goes on.
        """


ARRIVED, PAUSED, BEFORE_SOMETHING = 0, 1, 2  # why a leap ended


class Landing(NamedTuple):
    """Where a leap ended: the origin of the next segment, what holds there, and why it ended.

    ARRIVED at its target; PAUSED for want of room, to be taken up where it ended; BEFORE_SOMETHING that is not
    ordinary. instants (E, 2) are those of the events on the way, owners (E,) the components whose
    guards they are. outcome: makes what holds there, which a run that ends there does not ask for.
    """

    origin: Instant
    outcome: Callable[[], Outcome]
    end: int
    instants: np.ndarray
    owners: np.ndarray


class Leaps(Protocol):
    """A compiled mode loop of one run: whole segments and their ordinary events at once.

    It adds what it went over to the record as blocks (`hybridsim.engine.record.blocks`) and counts in its counters.
    leapt: a call of the kernel that `go` made ahead, for the next leap to begin with.
    """

    leapt: Leapt | None

    @property
    def place(self) -> tuple[np.ndarray, ...]:
        """What it remembers from leap to leap, in arrays that nobody changes."""

    @place.setter
    def place(self, place: np.ndarray) -> None:
        """Take it up again, all in a row, where a run goes on."""

    def anew(self) -> Leaps:
        """The same for another run, which remembers nothing yet; this one has never leapt."""

    def leap(
        self, origin: Instant, outcome: Outcome, p: np.ndarray, target: Instant, record: Trajectory
    ) -> Landing:
        """As far as ordinary events and the room for them go."""

    def go(self, origin: Instant, laid: Laid, target: Instant) -> Leapt | None:
        """Call the kernel, and leave it at that; None where it cannot be called."""

    def count(self, leapt: Leapt, counters: Counters) -> None:
        """Add what a call has cost."""

    def segments_of(self, leapt: Leapt) -> SegmentBlock:
        """The segments of a call that has some, and has let go of none."""

    def forget_segments(self, leapt: Leapt) -> bool:
        """Let go of the memory that is for segments but for the end of the last one, unless it is needed: then False.

        No leap follows.
        """


class Method(Protocol):
    """What the mode loop uses of an integrator."""

    @property
    def name(self) -> str:
        """What it is called."""

    @property
    def lacks(self) -> Mapping[str, str]:
        """What it cannot do, with reasons; "adaptive" where it has a step and no rtol."""

    @property
    def dense_is_accurate(self) -> bool:
        """Whether the dense output is as accurate as the method."""

    @property
    def leaps(self) -> bool:
        """Whether it has a compiled loop."""

    @property
    def stable_to(self) -> float:
        """How far along the negative axis of h*lambda its steps are stable; 0 where they are far enough for any."""

    @property
    def rounding(self) -> float:
        """What its steps round away at most, in units of rounding of the way that the states went."""

    def leaper(self, system: System, tolerances: Tolerances, longest: float) -> Leaps | None:
        """Its compiled loop for one run, no segment longer than `longest`; None where this model rules it out."""

    def start(
        self,
        flow: Flow,
        x0: np.ndarray,
        s_bound: float,
        tolerances: Tolerances,
        first_step: float | None,
        watch: Watch,
    ) -> Stepper:
        """Begin a segment at local time 0 towards s_bound (negative when time runs backward)."""
