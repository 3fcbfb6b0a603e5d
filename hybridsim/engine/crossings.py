"""The ordinary events of a compiled loop, as it wrote them down: one guard of one component fires at each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.engine.pieces import Occurrence
from hybridsim.engine.timepair import Instant

if TYPE_CHECKING:
    from hybridsim.engine.system import System


class Crossings(Sequence[Occurrence]):
    """E events in arrays; each is an occurrence for every component that changes its mode or is reset.

    Parameters
    ----------
    instants : (E, 2), high and low.
    fired : (E,), number of the guard that fired.
    before, after : (E, C), modes on both sides.
    states : (E, 2, n), x- and x+.
    """

    def __init__(
        self,
        system: System,
        instants: np.ndarray,
        fired: np.ndarray,
        before: np.ndarray,
        after: np.ndarray,
        states: np.ndarray,
    ) -> None:
        self._system, self._instants, self._fired = system, instants, fired
        self._before, self._after, self._states = before, after, states
        owners = system.owner[fired]
        taking_part = before != after
        taking_part[np.arange(len(fired)), owners] |= ~system.has_surface[owners]
        self._event, self._component = np.nonzero(taking_part)

    def __len__(self) -> int:
        return len(self._event)

    @property
    def until(self) -> Instant:
        """Time of the last one."""
        high, low = self._instants[self._event[-1]].tolist()
        return Instant(high, low)

    @property
    def times(self) -> np.ndarray:
        """Times rounded to doubles."""
        return (self._instants[:, 0] + self._instants[:, 1])[self._event]

    def chosen(self, component: str, kind: str | None) -> np.ndarray:
        """Mask of those of a component; all are transitions."""
        names = [a.name for a in self._system.automata]
        if component not in names or kind not in (None, "transition"):
            return np.zeros(len(self), dtype=np.bool_)
        return self._component == names.index(component)

    def since(self, first: int) -> Crossings:
        """Those from the first on."""
        later = object.__new__(Crossings)
        vars(later).update(vars(self), _event=self._event[first:], _component=self._component[first:])
        return later

    def __getitem__(self, i: Any, /) -> Any:
        if isinstance(i, slice):
            return [self[k] for k in range(*i.indices(len(self)))]
        e, c = int(self._event[i]), int(self._component[i])
        automaton, fired = self._system.automata[c], int(self._fired[e])
        source, target = int(self._before[e, c]), int(self._after[e, c])
        guard = ""
        if c == self._system.owner[fired]:
            guard = automaton.guard_names[source][automaton.guards[source].index(fired)]
        high, low = self._instants[e].tolist()
        return Occurrence(
            Instant(high, low),
            "transition",
            automaton.name,
            guard,
            automaton.modes[source],
            automaton.modes[target],
            -1,
            self._states[e, 0],
            self._states[e, 1],
        )
