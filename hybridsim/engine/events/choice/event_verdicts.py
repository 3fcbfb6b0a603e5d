"""Judge modes at one event in Python, from the Taylor series of their guards."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from hybridsim.engine.events.choice.verdict import (
    LEAVES,
    RELEASED,
    UNCHANGED,
    UNDECIDED,
    JudgedEvent,
    is_smooth,
    kind_of_change,
    verdict,
)
from hybridsim.engine.events.corner_sides import sides_along
from hybridsim.engine.events.event_data import EventData
from hybridsim.engine.native.kernels import Precompiled
from hybridsim.engine.series.bounded import ORDER

_NO_SERIES = np.zeros((2, 0, ORDER + 1))
_verdict, _kind_of_change, _is_smooth = map(Precompiled, (verdict, kind_of_change, is_smooth))


class EventVerdicts(EventData):
    """The verdicts on modes at one event."""

    is_thorough = False  # whether to judge all candidates, even if the choice does not need them

    def event(self, judged: np.ndarray = _NO_SERIES) -> JudgedEvent:
        """Return the data that a verdict reads; `judged` contains Taylor series of guards and their error bounds."""
        return JudgedEvent(
            self.before, self.at.z, self.fired, self.on_surface, self.released_to, judged, self.decreed,
            self.sides[None], self.orders[None], self.floors[None],
        )  # fmt: skip

    def judged(self, z: np.ndarray) -> JudgedEvent:
        """Return the data that a verdict on the modes `z` reads; the Taylor series follow the direction of the run."""
        series = self.series_of(z)
        judged = np.array([series.guards, series.guard_bounds])
        if not self.forward:
            judged[0, :, 1::2] *= -1.0
        return self.event(judged)

    def verdict(self, z: np.ndarray, components: Iterable[int]) -> int:
        """Return whether the guards of some components admit the modes `z` just after the event."""
        components = list(components)
        found = self.verdict_on_guards(z, components, self.is_continuous(z, components))
        return LEAVES if found == UNDECIDED and not self._can_hold(components, z) else found

    def _can_hold(self, members: list[int], z: np.ndarray) -> bool:
        """Return whether forces can hold all surfaces of the holding modes in `z` at zero at the same time."""
        automata = self.system.automata
        if sum(automata[c].has_surface and z[c] == automata[c].hold for c in members) < 2:
            return True
        numbers = self.system.guards_of(z)[members]
        return bool(np.isfinite(self.series_of(z).guards[numbers[numbers >= 0], 0]).all())

    def verdict_on_guards(self, z: np.ndarray, components: list[int], continuous: bool) -> int:
        """Return the verdict on the guards, without checking that forces can hold all surfaces at the same time."""
        members = np.array(components, dtype=np.int64)
        return int(_verdict(self.automata, None, 0, self.judged(z), z, members, continuous, True, 0))

    def is_continuous(self, z: np.ndarray, components: Iterable[int]) -> bool:
        """Return whether all unknowns stay continuous if this event ends in the modes `z`."""
        if self.jumped:
            return False
        members, event = np.array(list(components), dtype=np.int64), self.event()
        kind = _kind_of_change(self.automata, event, z, members)
        if kind != RELEASED:
            return bool(kind == UNCHANGED)
        jumps = self.system.jumps(self.at.s, self.at.x, self.at.p, z)
        return bool(_is_smooth(self.automata, event, z, members, jumps))

    def guard_verdicts(self, components: Iterable[int]) -> dict[int, int]:
        """Return, for each component, the verdict on its guards in the present modes."""
        continuous = self.is_continuous(self.at.z, range(len(self.system.automata)))
        return {c: self.verdict_on_guards(self.at.z, [c], continuous) for c in components}

    def with_modes(self, components: list[int], modes: np.ndarray) -> np.ndarray:
        """Return a copy of the modes with some of them replaced, and with the branches of abs, min and max updated."""
        z = self.at.z.copy()
        z[components] = modes
        return sides_along(self, np.maximum(z, 0), self.at.x)[0] if self.system.led else np.maximum(z, 0)
