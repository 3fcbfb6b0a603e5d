"""This module repeats the choice of modes at an event, and records each decision."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hybridsim.engine.events.choice.verdict import FINE, UNDECIDED
from hybridsim.engine.events.outcome import Situation
from hybridsim.engine.events.resolve import EventResolution


@dataclass(frozen=True)
class Look:
    """One combination of modes that was examined when modes were chosen.

    Parameters
    ----------
    at : the situation in which it was judged.
    z : modes of all components; components : those whose guards were judged.
    verdict : one of the codes of `hybridsim.engine.events.choice.verdict`.
    decreed : the number of leading derivatives of each guard that the event makes zero.
    motion : coefficients of the states and surfaces along its flow, with bounds of their rounding,
        (2, n + surfaces, orders); zero for a surface that it holds.
    free : a mask of the rows that describe its motion; a held state follows from its surface.
    """

    at: Situation
    z: np.ndarray
    components: tuple[int, ...]
    verdict: int
    decreed: np.ndarray
    motion: np.ndarray
    free: np.ndarray

    def is_as(self, other: Look) -> bool:
        """Return whether two combinations of modes give the same motion within rounding."""
        free = self.free & other.free
        (mine, error), (its, its_error) = self.motion[:, free], other.motion[:, free]
        return bool((np.abs(mine - its) <= error + its_error).all())


@dataclass
class Decision:
    """A choice of modes for several components: the examined combinations, the chosen modes and the changes.

    Parameters
    ----------
    first, last : the changes first to last - 1 of the resolution belong to it.
    z : modes of all components after it; empty if it found none.
    """

    first: int
    last: int = 0
    looks: list[Look] = field(default_factory=list)
    z: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @property
    def components(self) -> tuple[int, ...]:
        """Return the components whose guards the decision evaluated."""
        return self.looks[0].components if self.looks else ()

    def has_taken(self, look: Look) -> bool:
        """Return whether the decision chose the modes of a combination."""
        members = list(look.components)
        return bool(len(self.z) and (look.z[members] == self.z[members]).all())

    @property
    def taken(self) -> Look | None:
        """The combination of modes that the decision chose."""
        return next((look for look in self.looks if self.has_taken(look)), None)

    def with_verdict(self, verdict: int) -> list[Look]:
        """Return the combinations of modes with a given verdict."""
        return [look for look in self.looks if look.verdict == verdict]

    @property
    def fine(self) -> list[Look]:
        """Return the admissible combinations of modes."""
        return self.with_verdict(FINE)

    @property
    def undecided(self) -> list[Look]:
        """Return the combinations of modes that are undecided because of rounding."""
        return self.with_verdict(UNDECIDED)


class RecordedResolution(EventResolution):
    """Chooses the modes at an event, and records the verdict on every combination of modes."""

    is_thorough = True

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.decisions: list[Decision] = []

    def _choose_cluster(self, cluster: tuple[int, ...], open_: set[int]) -> tuple[str, str] | None:
        decision = Decision(len(self.changes))
        self.decisions.append(decision)
        failure = super()._choose_cluster(cluster, open_)
        decision.last = len(self.changes)
        if failure is None:
            decision.z = self.at.z.copy()
        return failure

    def verdict(self, z: np.ndarray, components: Iterable[int]) -> int:
        components = tuple(components)
        found = super().verdict(z, components)
        series = self.series_of(z)
        states = series.states, series.state_bounds
        surfaces = series.surfaces.copy(), series.surface_bounds.copy()
        held = [z[c] == self.system.automata[c].hold for c in self.system.surface_of]
        for coefficients in surfaces:
            coefficients[held] = 0.0
        motion = np.concatenate([states, surfaces], axis=1)
        free = np.ones(motion.shape[1], dtype=np.bool_)
        free[self.system.evaluated(z)] = False
        look = Look(replace(self.at), z.copy(), components, found, self.decreed.copy(), motion, free)
        self.decisions[-1].looks.append(look)
        return found

    def decision_of(self, component: int, number: int) -> Decision | None:
        """Return the decision that caused the change with a given number, or None if the change has another cause."""
        for decision in self.decisions:
            if component in decision.components and number < decision.last:
                return decision if decision.first <= number else None
        return None

    def decision_after(self, component: int, number: int) -> Decision | None:
        """Return the first decision about a component after the change with a given number."""
        return next((d for d in self.decisions if component in d.components and d.first > number), None)
