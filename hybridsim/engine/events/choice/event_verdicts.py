"""Judge modes at one event in Python, by the Taylor series of their guards."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from hybridsim.engine.events.choice.surface_intersection import can_hold
from hybridsim.engine.events.choice.verdict import (
    LEAVES,
    NO_SIDE,
    RELEASED,
    UNCHANGED,
    UNDECIDED,
    JudgedEvent,
    is_smooth,
    kind_of_change,
    verdict,
)
from hybridsim.engine.events.corner_sides import sides_along
from hybridsim.engine.events.outcome import Change, Situation
from hybridsim.engine.native.kernels import Precompiled
from hybridsim.engine.series.bounded import ORDER
from hybridsim.engine.series.short_series import Series
from hybridsim.engine.system.programs.mode_tables import automata_of
from hybridsim.engine.system.system import System

_NO_SERIES = np.zeros((2, 0, ORDER + 1))
_verdict, _kind_of_change, _is_smooth = map(Precompiled, (verdict, kind_of_change, is_smooth))


class EventVerdicts:
    """The verdicts on modes at one event; `before` contains the modes at the event, -1 for none."""

    is_thorough = False  # whether to judge all candidates, even if the choice does not need them

    def __init__(self, system: System, at: Situation, before: np.ndarray, forward: bool) -> None:
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

    def locate(self, located: set[int]) -> None:
        """Store the guards at which the event was located, and the components that the guards release."""
        self.fired[list(located)] = True
        for c, automaton in enumerate(self.system.automata):
            if automaton.has_surface and self.before[c] == automaton.hold:
                guards = enumerate(automaton.guards[automaton.hold])
                self.released_to[c] = next((j for j, g in guards if g in located), NO_SIDE)

    def series_of(self, z: np.ndarray, x: np.ndarray | None = None) -> Series:
        """Return the Taylor series along the flow of the modes `z`, at the present state or at `x`."""
        at = self.at
        x = at.x if x is None else x
        behind = (at.s, x, at.p, at.x_error)
        if not all(a is b for a, b in zip(behind, self.behind, strict=True)):
            self.behind, self.series = behind, {}
        key = z.tobytes()
        if key not in self.series:
            self.series[key] = self.system.series(at.s, x, at.p, z, at.x_error, at.s_error, at.is_put)
        return self.series[key]

    def fired_guards(self) -> list[tuple[int, int, int]]:
        """Return (component, index in its mode, guard number) of the located guards."""
        table = self.system.guards_of(self.at.z)
        return [
            (c, j, int(g))
            for c, row in enumerate(table)
            for j, g in enumerate(row)
            if g >= 0 and self.fired[g]
        ]

    def event(self, judged: np.ndarray = _NO_SERIES) -> JudgedEvent:
        """Return the data for verdicts, with the series of the guards and their error bounds (2, G, 4)."""
        return JudgedEvent(
            self.before, self.at.z, self.fired, self.on_surface, self.released_to, judged, self.decreed,
            self.sides[None], self.orders[None], self.floors[None],
        )  # fmt: skip

    def judged(self, z: np.ndarray) -> JudgedEvent:
        """Return the data for verdicts on the modes `z`, forward or backward in time."""
        series = self.series_of(z)
        judged = np.array([series.guards, series.guard_bounds])
        if not self.forward:
            judged[0, :, 1::2] *= -1.0
        return self.event(judged)

    def verdict(self, z: np.ndarray, components: Iterable[int]) -> int:
        """Return whether the guards of some components admit the modes `z` just after the event."""
        components = list(components)
        found = self.verdict_on_guards(z, components, self.is_continuous(z, components))
        return LEAVES if found == UNDECIDED and not can_hold(self, components, z) else found

    def verdict_on_guards(self, z: np.ndarray, components: list[int], continuous: bool) -> int:
        """Return the verdict on the guards, without a check that the held surfaces are compatible."""
        members = np.array(components, dtype=np.int64)
        return int(_verdict(self.automata, None, 0, self.judged(z), z, members, continuous, True, 0))

    def is_continuous(self, z: np.ndarray, components: Iterable[int]) -> bool:
        """Return whether no change of mode so far has changed an unknown."""
        if self.jumped:
            return False
        members, event = np.array(list(components), dtype=np.int64), self.event()
        kind = _kind_of_change(self.automata, event, z, members)
        if kind != RELEASED:
            return bool(kind == UNCHANGED)
        jumps = self.system.jumps(self.at.s, self.at.x, self.at.p, z)
        return bool(_is_smooth(self.automata, event, z, members, jumps))

    def guard_verdicts(self, components: Iterable[int]) -> dict[int, int]:
        """Return a verdict for each component, on its guards in the present modes."""
        continuous = self.is_continuous(self.at.z, range(len(self.system.automata)))
        return {c: self.verdict_on_guards(self.at.z, [c], continuous) for c in components}

    def with_modes(self, components: list[int], modes: np.ndarray) -> np.ndarray:
        """Return the modes after changes of some modes, with corners on the sides of the motion."""
        z = self.at.z.copy()
        z[components] = modes
        return sides_along(self, np.maximum(z, 0), self.at.x)[0] if self.system.led else np.maximum(z, 0)
