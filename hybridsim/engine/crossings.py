"""The ordinary events of a compiled loop, as it wrote them down: one guard of one component fires at each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.engine.jit import kernel
from hybridsim.engine.pieces import Occurrence
from hybridsim.engine.timepair import Instant

if TYPE_CHECKING:
    from hybridsim.engine.system import System


@kernel
def _taking_part(fired: Any, before: Any, after: Any, owner: Any, has_surface: Any) -> int:
    """How many changes of mode there are, and resets that change none."""
    count = 0
    for e in range(fired.shape[0]):
        for c in range(before.shape[1]):
            count += before[e, c] != after[e, c] or (c == owner[fired[e]] and not has_surface[c])
    return count


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
        self._first = 0
        self._count = int(_taking_part(fired, before, after, system.owner, system.has_surface))

    def __len__(self) -> int:
        return self._count - self._first

    @cached_property
    def _places(self) -> tuple[np.ndarray, np.ndarray]:
        """Event and component of each occurrence."""
        owners = self._system.owner[self._fired]
        taking_part = self._before != self._after
        taking_part[np.arange(len(owners)), owners] |= ~self._system.has_surface[owners]
        events, components = np.nonzero(taking_part)
        return events[self._first :], components[self._first :]

    @property
    def until(self) -> Instant:
        """Time of the last one."""
        return Instant(*self._instants[-1].tolist())

    @property
    def times(self) -> np.ndarray:
        """Times rounded to doubles."""
        return (self._instants[:, 0] + self._instants[:, 1])[self._places[0]]

    def chosen(self, component: str, kind: str | None) -> np.ndarray:
        """Mask of those of a component; all are transitions, or changes of a corner's side."""
        names = [a.name for a in self._system.automata]
        if component not in names or kind not in (None, self._system.automata[names.index(component)].kind):
            return np.zeros(len(self), dtype=np.bool_)
        return self._places[1] == names.index(component)

    def since(self, first: int) -> Crossings:
        """Those from the first on."""
        later = copy(self)
        vars(later).pop("_places", None)
        later._first += first
        return later

    def __getitem__(self, i: Any, /) -> Any:
        if isinstance(i, slice):
            return list(self._made(i))
        k = range(len(self))[i]
        return next(self._made(slice(k, k + 1)))

    def __iter__(self) -> Iterator[Occurrence]:
        return self._made(slice(None))

    def _made(self, chosen: slice) -> Iterator[Occurrence]:
        automata, owner = self._system.automata, self._system.owner.tolist()
        e, c = (places[chosen] for places in self._places)
        changes = zip(
            self._fired[e].tolist(), self._before[e, c].tolist(), self._after[e, c].tolist(), strict=True
        )
        rows = zip(c.tolist(), changes, self._instants[e].tolist(), self._states[e], strict=True)
        for component, (fired, source, target), (high, low), (x_minus, x_plus) in rows:
            automaton, guard = automata[component], ""
            if component == owner[fired]:
                guard = automaton.guard_names[source][automaton.guards[source].index(fired)]
            names = (automaton.name, guard, automaton.modes[source], automaton.modes[target])
            yield Occurrence(Instant(high, low), automaton.kind, *names, -1, x_minus, x_plus)
