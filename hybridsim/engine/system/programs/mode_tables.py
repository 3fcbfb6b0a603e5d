"""A model's automata as arrays, and the tapes of every vector of modes that a run has met, for compiled loops."""

from __future__ import annotations

import math
from contextlib import suppress
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import ENABLED, compile_series, is_kept
from hybridsim.engine.native.llvm_text import TooLong
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.series.emit_bounds import bounds_text, can_bound
from hybridsim.engine.system.programs.mode_code import (
    KNOWN,
    NEVER,
    WORTH,
    computed_rates,
    constant_rows,
    fading,
    given,
    kept,
    mode_tape,
)
from hybridsim.engine.system.programs.modes_index import index_of
from hybridsim.engine.system.system import System
from hybridsim.forks import SharedLock

_ALL = 27  # vectors of modes, as of three contacts: so many are on a shelf from the first on


class Automata(NamedTuple):
    """What does not change: components, their guards, clusters, choices. -1 stands for none.

    guards_of (C, M, W); hold, above, surface (C,); pin (C, most): states
    that a holding mode evaluates; owner, place (G,): component of a guard, index in its mode;
    cluster_start (C + 1,), cluster (members): the cluster of each component; target, reset (C, M, W, T) of choices;
    reset_start, reset_slot: what each reset sets, a state (its index) or a discrete state (n + its index);
    is_corner, is_unique, is_unilateral (C,).
    """

    guards_of: np.ndarray
    hold: np.ndarray
    above: np.ndarray
    pin: np.ndarray
    surface: np.ndarray
    owner: np.ndarray
    place: np.ndarray
    cluster_start: np.ndarray
    cluster: np.ndarray
    target: np.ndarray
    reset: np.ndarray
    reset_start: np.ndarray
    reset_slot: np.ndarray
    is_corner: np.ndarray
    is_unique: np.ndarray
    is_unilateral: np.ndarray


class Tapes(NamedTuple):
    """One row or one slice for each vector of modes: modes, lean rows, those of high orders, constant rows, active
    guards, registers. places: see `hybridsim.engine.system.programs.modes_index`.

    computed: whether the rate of a state is worked out as time goes on, and is no constant and no other state. fading:
    see `hybridsim.engine.system.programs.mode_code`.
    bounds: addresses of code for short series of the guards with bounds, 0 where there is none; lacked: how often it
    was missed.
    """

    modes: np.ndarray
    places: np.ndarray
    lean_start: np.ndarray
    lean: np.ndarray
    high_start: np.ndarray
    high: np.ndarray
    constant_start: np.ndarray
    constant: np.ndarray
    active_start: np.ndarray
    active: np.ndarray
    fading_start: np.ndarray
    fading: np.ndarray
    derivatives: np.ndarray
    computed: np.ndarray
    guards: np.ndarray
    bounds: np.ndarray
    lacked: np.ndarray


def automata_of(system: System) -> Automata:
    """The arrays of a system's automata, as kernels take them."""
    automata: Automata = system.code.shared("automata", lambda: packed(_automata(system)))
    return automata


def shelf_of(system: System) -> TapeShelf:
    """The shelf of all systems of one structure."""
    shelf: TapeShelf = system.code.shared("shelf", lambda: TapeShelf(system))
    return shelf


def _automata(system: System) -> Automata:
    automata, n = system.automata, system.n
    count = len(automata)
    modes = max((len(a.modes) for a in automata), default=1)
    widest = max((len(g) for a in automata for g in a.guards), default=0) or 1
    choices = max((len(t) for a in automata for m in a.targets for t in m), default=0) or 1
    guards_of = np.full((count, modes, widest), -1, dtype=np.int64)
    target = np.full((count, modes, widest, choices), -1, dtype=np.int64)
    reset = np.full_like(target, -1)
    place = np.zeros(system.guard_count, dtype=np.int64)
    for c, automaton in enumerate(automata):
        for m, guards in enumerate(automaton.guards):
            guards_of[c, m, : len(guards)] = guards
            for j, g in enumerate(guards):
                place[g] = j
                for k, to in enumerate(automaton.targets[m][j]):
                    target[c, m, j, k] = to
                    reset[c, m, j, k] = system.resets.get(("choice", c, m, j, k), (-1, ()))[0]
    slots = {name: i for i, name in enumerate(system.names)}
    slots |= {d.name: n + i for i, d in enumerate(system.model.discrete)}
    reset_slots = [[slots[name] for name in targets] for _, targets in system.resets.values()]
    cluster_of: list[list[int]] = [[] for _ in automata]
    for members in system.clusters:
        for c in members:
            cluster_of[c] = list(members)
    pin = np.full((count, max((len(held) for held in system.pins.values()), default=1)), -1, dtype=np.int64)
    for c, held in system.pins.items():
        pin[c, : len(held)] = held
    order = {c: k for k, c in enumerate(system.surface_of)}
    return Automata(
        guards_of,
        np.array([a.hold for a in automata], dtype=np.int64),
        np.array([a.above for a in automata], dtype=np.int64),
        pin,
        np.array([order.get(c, -1) for c in range(count)], dtype=np.int64),
        system.owner,
        place,
        *_flat(cluster_of),
        target,
        reset,
        *_flat(reset_slots),
        system.is_corner,
        np.array([a.is_unique for a in automata], dtype=np.bool_),
        np.array([a.is_unilateral for a in automata], dtype=np.bool_),
    )


def _flat(lists: Any) -> tuple[np.ndarray, np.ndarray]:
    """Where each of several lists begins, and all of them in a row."""
    starts = np.cumsum([0, *(len(part) for part in lists)])
    return starts.astype(np.int64), np.array([i for part in lists for i in part], dtype=np.int64)


class TapeShelf:
    """The tapes of the modes met so far; grows when a run comes to a new vector of modes.

    Where there are few it holds all of them from the first on: what is on the shelf decides which way an event is
    taken, and so the last digits, which then do not depend on what was run before.
    """

    def __init__(self, system: System) -> None:
        self.system = system
        self._counts = [len(automaton.modes) for automaton in system.automata]
        self._met: dict[bytes, np.ndarray] = {}
        self._surrounded: set[bytes] = set()
        self._lock = SharedLock()
        self._engines: list[Any] = []  # what keeps machine code alive
        self._code = np.zeros((2, 0), dtype=np.int64)
        self._rows: list[_ModeRows] = []  # of the vectors of modes met
        self.tapes = self._stacked()

    def look(self) -> None:
        """Get code ready for the short series that were missed often."""
        tapes = self.tapes
        if not ENABLED or max(tapes.lacked.tolist(), default=0) < KNOWN:
            return
        for k in np.flatnonzero(tapes.lacked >= KNOWN).tolist():
            place = kept(self.system, "bounds", tapes.modes[k])
            if tapes.lacked[k] >= WORTH or is_kept(place):
                with self._lock:
                    self._make(tapes.modes[k], place, k)

    def _make(self, z: np.ndarray, place: Path | None, k: int) -> None:
        system, tapes = self.system, self.tapes
        if tapes.lacked[k] < KNOWN:  # another thread was first
            return
        tape, rows = mode_tape(system, z), constant_rows(system, z)
        tapes.lacked[k] = NEVER
        if can_bound(tape, rows):
            numbers = np.flatnonzero(system.active(z)).tolist()
            with suppress(TooLong):  # it stays with the interpreter
                (address,), engine = compile_series(
                    place,
                    ("bounds_0",),
                    lambda: bounds_text(tape, rows, given(system), numbers, system.guard_count),
                )
                self._engines.append(engine)
                tapes.bounds[k] = address

    def surround(self, z: np.ndarray) -> None:
        """Put the tapes of a vector of modes on the shelf, and those of the modes that one event may lead to."""
        if z.tobytes() in self._surrounded:
            return
        with self._lock:
            met = len(self._met)
            if not met and math.prod(self._counts) <= _ALL:
                for modes in product(*map(range, self._counts)):
                    self._met[np.array(modes, dtype=np.int64).tobytes()] = np.array(modes, dtype=np.int64)
            self._met.setdefault(z.tobytes(), z.copy())
            for c, automaton in enumerate(self.system.automata):
                for m in range(len(automaton.modes)):
                    other = z.copy()
                    other[c] = m
                    self._met.setdefault(other.tobytes(), other)
            if len(self._met) > met:
                self.tapes = self._stacked()
            self._surrounded.add(z.tobytes())

    def rows_of(self, vectors: np.ndarray) -> np.ndarray:
        """Rows of these vectors of modes (k, components), which are put on the shelf where they are not there."""
        with self._lock:
            met = len(self._met)
            for z in vectors:
                self._met.setdefault(z.tobytes(), z.copy())
            if len(self._met) > met:
                self.tapes = self._stacked()
            numbers = {z: k for k, z in enumerate(self._met)}
        return np.array([numbers[z.tobytes()] for z in vectors], dtype=np.int64)

    def _stacked(self) -> Tapes:
        system, met = self.system, list(self._met.values())
        self._rows += [_ModeRows.of(system, z) for z in met[len(self._rows) :]]
        rows = self._rows
        modes = np.array(met, dtype=np.int64).reshape(len(met), len(system.automata))
        code = np.zeros((2, len(met)), dtype=np.int64)
        code[:, : self._code.shape[1]] = self._code
        self._code = code
        tapes: Tapes = packed(
            Tapes(
                modes,
                index_of(modes),
                *in_a_row([one.lean for one in rows]),
                *in_a_row([one.high for one in rows]),
                *in_a_row([one.constant for one in rows]),
                *in_a_row([one.active for one in rows], columns=()),
                *in_a_row([np.array(one.fading, dtype=np.int64) for one in rows], columns=()),
                np.array([one.derivatives for one in rows], dtype=np.int64).reshape(len(met), system.n),
                np.array([one.computed for one in rows], dtype=np.bool_).reshape(len(met), system.n),
                np.array([one.guards for one in rows], dtype=np.int64).reshape(len(met), system.guard_count),
                *code,
            )
        )
        return tapes


class _ModeRows(NamedTuple):
    """What `Tapes` has of one vector of modes."""

    lean: np.ndarray
    high: np.ndarray
    constant: np.ndarray
    active: np.ndarray
    derivatives: np.ndarray
    computed: list[bool]
    fading: list[int]
    guards: np.ndarray

    @classmethod
    def of(cls, system: System, z: np.ndarray) -> _ModeRows:
        """Worked out once: a shelf that grows by a few vectors of modes again and again takes up the others."""
        tape = system.lean_tape(z)
        return cls(
            tape.rows,
            np.array(system.high_rows(z), dtype=np.int64).reshape(-1, 5),
            tape.constant_rows,
            np.flatnonzero(system.active(z)),
            tape.derivatives,
            computed_rates(system, z),
            fading(system, z),
            tape.guards,
        )


def in_a_row(parts: list[np.ndarray], columns: tuple[int, ...] = (5,)) -> tuple[np.ndarray, np.ndarray]:
    """Where each of several arrays of whole numbers begins, and all of them; columns: shape of an entry."""
    starts = np.cumsum([0, *(len(part) for part in parts)]).astype(np.int64)
    return starts, np.concatenate([np.zeros((0, *columns), dtype=np.int64), *parts])
