"""This module defines the data of one event, which all steps of its resolution read and change."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from hybridsim.engine.events.choice.verdict import NO_SIDE
from hybridsim.engine.events.outcome import Change, Situation
from hybridsim.engine.series.short_series import Series
from hybridsim.engine.system.automaton import RESET
from hybridsim.engine.system.programs.mode_tables import automata_of
from hybridsim.engine.system.system import System


class EventData:
    """The data of one event while it is resolved: state, located guards, and the changes so far.

    before : the modes at the event, -1 for none.
    scope : the components decided here; a method with its own rules for surfaces leaves those out.
    """

    def __init__(
        self,
        system: System,
        at: Situation,
        before: np.ndarray,
        forward: bool,
        scope: Iterable[int] | None = None,
    ) -> None:
        self.system, self.at, self.before, self.forward = system, at, before, forward
        self.automata = automata_of(system)
        components, guards = len(system.automata), system.guard_count
        self.fired = np.zeros(guards, dtype=np.bool_)
        self.on_surface = np.zeros(components, dtype=np.bool_)
        self.released_to = np.full(components, NO_SIDE, dtype=np.int64)
        self.decreed = np.zeros(guards, dtype=np.int64)
        self.sides = np.ones(guards, dtype=np.int64)
        self.orders, self.floors = np.zeros(guards, dtype=np.int64), np.zeros(guards)
        self.changes: list[Change] = []
        self.warnings: list[str] = []
        self.jumped = False  # whether a reset or an unknown made the flow jump
        # Taylor series by modes, and the arrays at which they were computed; those are replaced, never modified
        self.series: dict[bytes, Series] = {}
        self.behind: tuple[object, ...] = (None,) * 4
        # run-time vectors by modes in which whole numbers differ from those of a present vector
        self.vectors: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}
        self.is_kinked = False  # whether a corner changed its side: the flow is continuous, its slope is not
        self.scope = set(range(components)) if scope is None else set(scope)
        self.rank: dict[int, int] = {}  # position of each guard in the order in which they reached zero

    def locate(self, located: set[int]) -> None:
        """Store the guards that were located at zero, and the guard that releases each held component."""
        self.fired[list(located)] = True
        for c, automaton in enumerate(self.system.automata):
            if automaton.has_surface and self.before[c] == automaton.hold:
                guards = enumerate(automaton.guards[automaton.hold])
                self.released_to[c] = next((j for j, g in guards if g in located), NO_SIDE)

    def series_of(self, z: np.ndarray, x: np.ndarray | None = None, p: np.ndarray | None = None) -> Series:
        """Return the Taylor series along the flow of the modes `z`, at the present state or at `x`.

        p : the run-time vector; by default the present one, with the whole numbers that belong to `z`.
        """
        at, key = self.at, z.tobytes()
        x = at.x if x is None else x
        if p is None:
            present, found = self.vectors.get(key, (None, at.p))
            p = found if present is at.p else at.p
        behind = (at.s, x, p, at.x_error)
        if not all(a is b for a, b in zip(behind, self.behind, strict=True)):
            self.behind, self.series = behind, {}
        if key not in self.series:
            self.series[key] = self.system.series(at.s, x, p, z, at.x_error, at.s_error, at.is_put)
        return self.series[key]

    def fired_guards(self) -> list[tuple[int, int, int]]:
        """Return (component, index in its mode, guard number) of each guard that was located at zero."""
        table = self.system.guards_of(self.at.z)
        return [
            (c, j, int(g))
            for c, row in enumerate(table)
            for j, g in enumerate(row)
            if g >= 0 and self.fired[g]
        ]

    def take_sides(self, open_: set[int]) -> None:
        """Set each component with a surface to the mode of the side on which the state lies.

        open_: the components to be decided on their surfaces. A component that a reset moved off its surface is
        removed, and one that came to its surface is added.
        """
        at, system = self.at, self.system
        free = at.p.copy()
        free[system.layout.pin_at] = 0.0  # the states as they are, not projected by a holding mode
        series = system.series(at.s, at.x, free, np.maximum(at.z, 0), at.x_error, at.s_error, at.is_put)
        for k, c in enumerate(system.surface_of):
            automaton, value = system.automata[c], series.surfaces[k, 0]
            if abs(value) <= series.surface_bounds[k, 0]:
                if at.z[c] in (-1, automaton.hold) or self.on_surface[c] or automaton.is_unique:
                    open_.add(c)
                continue
            if value < 0.0 and automaton.is_unilateral:
                open_.add(c)
                continue
            open_.discard(c)
            self.on_surface[c] = False
            side = automaton.above if value > 0.0 else automaton.below
            self.fired[automaton.guards[side][0]] = False  # it was located at its surface before the reset
            if at.z[c] not in (-1, side):
                self.changes.append(Change(c, RESET, int(at.z[c]), side, at.x, at.x))
            at.z[c] = side

    def pinned_states(self, components: list[int]) -> np.ndarray:
        """Return a mask (n,) of the states that some components determine in their holding modes."""
        mask = np.zeros(self.system.n, dtype=np.bool_)
        mask[[i for c in components for i in self.system.pins.get(c, ())]] = True
        return mask
