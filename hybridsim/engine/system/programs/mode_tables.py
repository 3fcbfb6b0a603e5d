"""This module builds arrays for compiled loops: the automata of a model, and instruction tapes of modes."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.series.emit_bounds import bounds_text, can_bound
from hybridsim.engine.series.emit_series import ModeTape
from hybridsim.engine.system.per_structure import per_structure
from hybridsim.engine.system.programs.growing_rows import GrowingArray, GrowingLists
from hybridsim.engine.system.programs.mode_code import (
    ModeCompiler,
    computed_rates,
    constant_rows,
    constant_sources,
    fading,
)
from hybridsim.engine.system.programs.modes_index import index_of
from hybridsim.engine.system.system import System
from hybridsim.forks import SharedLock
from hybridsim.model.parts.component import MonitorCorner

MAX_COMPLETE_SET = (
    27  # largest number of combinations of modes that a complete set may have, as for three contacts
)


class Automata(NamedTuple):
    """The constant structure of a model: components, guards, clusters and choices; -1 means none."""

    guards_of: np.ndarray  # guard numbers (C, M, W) of component and mode
    hold: np.ndarray  # holding mode (C,)
    above: np.ndarray  # mode above the surface (C,)
    pin: np.ndarray  # states (C, most) that a holding mode evaluates
    surface: np.ndarray  # number of the surface (C,)
    owner: np.ndarray  # component (G,) of each guard
    place: np.ndarray  # index (G,) of each guard in its mode
    cluster_start: np.ndarray  # start (C + 1,) of each cluster in `cluster`
    cluster: np.ndarray  # members of the cluster of each component
    target: np.ndarray  # target mode (C, M, W, T) of each choice
    reset: np.ndarray  # reset (C, M, W, T) of each choice
    reset_start: np.ndarray  # start of each reset in `reset_slot`
    reset_slot: np.ndarray  # what a reset sets: index of a state, or n + index of a discrete state
    is_corner: np.ndarray  # (C,)
    is_unique: np.ndarray  # (C,)
    is_unilateral: np.ndarray  # (C,)
    is_monitor: np.ndarray  # (C,)


class Tapes(NamedTuple):
    """The instruction tapes of several combinations of modes, joined in arrays."""

    modes: np.ndarray  # modes (K, C)
    hash_slots: np.ndarray  # hash table: `hybridsim.engine.system.programs.modes_index`
    optimised_start: np.ndarray
    optimised: np.ndarray  # rows of the optimised tapes
    constant_start: np.ndarray
    constant: np.ndarray  # rows executed once per segment
    active_start: np.ndarray
    active: np.ndarray  # active guards
    fading_start: np.ndarray
    fading: np.ndarray  # vanishing functions: `hybridsim.engine.system.programs.mode_code`
    derivatives: np.ndarray  # registers of the rates
    computed: np.ndarray  # whether the rate of each state is computed
    guards: np.ndarray  # registers of the guards
    bounds: np.ndarray  # addresses of code for short series of the guards with bounds, 0 for none
    lacked: np.ndarray  # number of times that this code was missing


@per_structure
def automata_of(system: System) -> Automata:
    """Return the arrays of a system's automata, packed for kernels."""
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
    packed_automata: Automata = packed(
        Automata(
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
            np.array([isinstance(c, MonitorCorner) for c in system.model.all_components()], dtype=np.bool_),
        )
    )
    return packed_automata


def _flat(lists: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the start of each list in a concatenation of lists, and the concatenation."""
    starts = np.cumsum([0, *(len(part) for part in lists)])
    return starts.astype(np.int64), np.array([i for part in lists for i in part], dtype=np.int64)


class TapeCache:
    """The instruction tapes of the modes that occurred so far; new combinations of modes are added.

    No decision depends on which tapes exist: a compiled loop that lacks one returns, and goes on when it was added.
    """

    def __init__(self, system: System) -> None:
        self.system = system
        self._numbers: dict[bytes, int] = {}  # row of each combination
        self._lock = SharedLock()
        self._compiler = ModeCompiler(system, "bounds", ("bounds",), self._text)
        components, guards = len(system.automata), system.guard_count
        self._combinations = math.prod(len(automaton.modes) for automaton in system.automata)
        self._modes, self._code = GrowingArray((components,)), (GrowingArray(), GrowingArray())
        self._lists = GrowingLists(), GrowingLists(), GrowingLists(()), GrowingLists(())
        self._rows = GrowingArray((system.n,)), GrowingArray((system.n,), np.bool_), GrowingArray((guards,))
        self.tapes = self._packed(0)

    def look(self) -> None:
        """Compile code for modes in which many short series were computed without compiled code."""
        tapes = self.tapes

        def put(k: int, addresses: list[int]) -> None:
            tapes.bounds[k] = addresses[0]

        self._compiler.prepare(tapes.modes, tapes.lacked, put)

    def _text(self, tape: ModeTape, z: np.ndarray) -> Callable[[], str] | None:
        """Return a function that writes code for short Taylor series in one combination of modes, or None."""
        system, rows = self.system, constant_rows(self.system, z)
        if not can_bound(tape, rows):
            return None
        numbers = np.flatnonzero(system.active(z)).tolist()
        return lambda: bounds_text(tape, rows, constant_sources(system), numbers, system.guard_count)

    def with_modes(self, z: np.ndarray) -> Tapes:
        """Return instruction tapes that include the tape of a given combination of modes."""
        if z.tobytes() not in self._numbers:
            self.rows_of(z[None])
        return self.tapes

    def with_complete_set(self) -> Tapes:
        """Return the instruction tapes of all combinations of modes if these are few, otherwise the tapes so far.

        The tables of linear modes of few combinations are made at once.
        """
        if len(self._numbers) < self._combinations <= MAX_COMPLETE_SET:
            counts = [len(automaton.modes) for automaton in self.system.automata]
            self.rows_of(np.array(list(product(*map(range, counts))), dtype=np.int64))
        return self.tapes

    def rows_of(self, vectors: np.ndarray) -> np.ndarray:
        """Return the rows of some combinations of modes, and add the missing rows."""
        with self._lock:
            numbers, added = self._numbers, dict[bytes, int]()
            for z in vectors:
                if (key := z.tobytes()) not in numbers and key not in added:
                    k = added[key] = len(numbers) + len(added)
                    self._put(k, z)
            if added:
                self.tapes = self._packed(len(numbers) + len(added))
                numbers.update(added)  # last, because another thread may look for a number without the lock
            return np.array([numbers[z.tobytes()] for z in vectors], dtype=np.int64)

    def _put(self, k: int, z: np.ndarray) -> None:
        """Write the rows of a combination of modes to all arrays."""
        system, tape = self.system, self.system.optimised_tape(z)
        of_lists = tape.rows, tape.constant_rows, np.flatnonzero(system.active(z)), fading(system, z)
        for lists, part in zip(self._lists, of_lists, strict=True):
            lists.put(k, part)
        of_rows = tape.derivatives, computed_rates(system, z), tape.guards
        for rows, one in zip(self._rows, of_rows, strict=True):
            rows.put(k, [one])
        for code in self._code:
            code.put(k, [0])
        self._modes.put(k, [z])

    def _packed(self, count: int) -> Tapes:
        modes = self._modes.up_to(count)
        tapes: Tapes = packed(
            Tapes(
                modes,
                index_of(modes),
                *(array for lists in self._lists for array in lists.up_to(count)),
                *(rows.up_to(count) for rows in (*self._rows, *self._code)),
            )
        )
        return tapes


tape_cache_of = per_structure(TapeCache)
