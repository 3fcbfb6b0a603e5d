"""A settling that remembers its decisions, and what each looked at, with the values of then."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.engine.decide import FINE, UNDECIDED
from hybridsim.engine.settle import Settling
from hybridsim.engine.system import Series

if TYPE_CHECKING:
    from hybridsim.engine.outcome import Situation


@dataclass(frozen=True)
class Look:
    """One combination of modes that was judged.

    Parameters
    ----------
    at : what it was judged with.
    z : modes of all components; components : those whose guards were judged.
    verdict : as `hybridsim.engine.decide` has it.
    decreed : leading zeros of each guard, by the event.
    motion : coefficients of the states and of the surfaces along its flow, with bounds of their rounding,
        (2, n + surfaces, orders); of a surface that it holds they are zero.
    free : the rows of it that say how it moves: a held state is evaluated from its surface.
    """

    at: Situation
    z: np.ndarray
    components: tuple[int, ...]
    verdict: int
    decreed: np.ndarray
    motion: np.ndarray
    free: np.ndarray

    def is_as(self, other: Look) -> bool:
        """Whether both are the same motion to rounding."""
        free = self.free & other.free
        (mine, error), (its, its_error) = self.motion[:, free], other.motion[:, free]
        return bool((np.abs(mine - its) <= error + its_error).all())


@dataclass
class Decision:
    """One joint decision: what it looked at, the modes that it ended with, and the changes it is the cause of.

    Parameters
    ----------
    first, last : of the changes of the settling, by number, its own are those from first up to last.
    z : modes of all components after it; empty where it found none.
    """

    first: int
    last: int = 0
    looks: list[Look] = field(default_factory=list)
    z: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @property
    def components(self) -> tuple[int, ...]:
        """Those whose guards were judged."""
        return self.looks[0].components if self.looks else ()

    def has_taken(self, look: Look) -> bool:
        """Whether it ended with the modes of a look."""
        members = list(look.components)
        return bool(len(self.z) and (look.z[members] == self.z[members]).all())

    @property
    def taken(self) -> Look | None:
        """The look that it ended with."""
        return next((look for look in self.looks if self.has_taken(look)), None)

    def with_verdict(self, verdict: int) -> list[Look]:
        """The looks with this verdict."""
        return [look for look in self.looks if look.verdict == verdict]

    @property
    def fine(self) -> list[Look]:
        """Those that are admissible."""
        return self.with_verdict(FINE)

    @property
    def undecided(self) -> list[Look]:
        """Those that rounding leaves open."""
        return self.with_verdict(UNDECIDED)


class Watched(Settling):
    """It judges all candidates, also those that no choice needs."""

    is_thorough = True

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.decisions: list[Decision] = []

    def _decide_cluster(self, cluster: tuple[int, ...], open_: set[int]) -> tuple[str, str] | None:
        decision = Decision(len(self.changes))
        self.decisions.append(decision)
        failure = super()._decide_cluster(cluster, open_)
        decision.last = len(self.changes)
        if failure is None:
            decision.z = self.at.z.copy()
        return failure

    def verdict(self, z: np.ndarray, components: Iterable[int]) -> int:
        components = tuple(components)
        found = super().verdict(z, components)
        decreed = self._decreed(z, self._continuous(z, components))
        series = self.series_of(z)
        assert isinstance(series, Series)  # models with surfaces are made from expressions
        states = series.states, series.E[series.place.states]
        surfaces = series.surfaces.copy(), series.surface_bounds.copy()
        held = [z[c] == self.system.automata[c].hold for c in self.system.surface_of]
        for coefficients in surfaces:
            coefficients[held] = 0.0
        motion = np.concatenate([states, surfaces], axis=1)
        free = np.ones(motion.shape[1], dtype=np.bool_)
        free[self.system.evaluated(z)] = False
        look = Look(replace(self.at), z.copy(), components, found, decreed, motion, free)
        self.decisions[-1].looks.append(look)
        return found

    def decision_of(self, component: int, number: int) -> Decision | None:
        """The decision that made a change of a component, by its number; None where no decision did."""
        for decision in self.decisions:
            if component in decision.components and number < decision.last:
                return decision if decision.first <= number else None
        return None

    def decision_after(self, component: int, number: int) -> Decision | None:
        """The first decision on a component after a change, by its number."""
        return next((d for d in self.decisions if component in d.components and d.first > number), None)
