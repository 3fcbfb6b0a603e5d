"""Choose the modes of coupled components at an event, in Python; report if the motion is not unique."""

from __future__ import annotations

import math

import numpy as np

from hybridsim.engine.events.choice.candidates import completed, judged_candidates
from hybridsim.engine.events.choice.event_verdicts import EventVerdicts
from hybridsim.engine.events.choice.joint_choice import NONE, NONUNIQUE, joint_candidates
from hybridsim.engine.events.choice.surface_intersection import (
    is_one_motion,
    keeps_nothing,
    on_its_side,
    refused,
    rivals,
)
from hybridsim.engine.events.choice.uniqueness import below_limits, other_outcomes
from hybridsim.engine.events.choice.verdict import LEAVES
from hybridsim.engine.events.corner_start import cross, past_zero, vanishing_surfaces
from hybridsim.engine.events.diagnosis import rates_without_value
from hybridsim.engine.events.outcome import Change
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.system import System


def with_tied(system: System, members: list[int]) -> list[int]:
    """Return the given components, and the contacts whose velocity is proportional to the rate of a given gap."""
    tied = {along for gap, along, is_one in system.stop_couplings if is_one and gap in members}
    return sorted(tied.union(members))


def together(system: System, members: list[int], candidates: np.ndarray) -> np.ndarray:
    """Return the candidates in which a gap and the friction along its direction are both held or both free.

    If their velocities differ (a stop beside a belt), candidates in which both hold are removed.
    """
    is_allowed = np.ones(len(candidates), dtype=np.bool_)
    for gap, along, is_one in system.stop_couplings:
        if gap in members and along in members:
            a, b = (candidates[:, members.index(c)] == system.automata[c].hold for c in (gap, along))
            is_allowed &= (a == b) if is_one else ~(a & b)
    return candidates[is_allowed]


_SEVERAL_MOTIONS = "several motions are admissible"
_MAX_CANDIDATES = 3**8  # a cluster of more components needs a complementarity solver, not enumeration

Failure = tuple[str, str]  # status and message


class ClusterChoice(EventVerdicts):
    """The joint choices of modes at one event, made in Python."""

    def choose_jointly(self, open_: set[int]) -> tuple[str, str] | None:
        """Choose the modes of each cluster of components in which at least one mode is undecided."""
        for cluster in self.system.clusters:
            if open_ & set(cluster):
                failure = self._choose_cluster(cluster, open_)
                if failure and failure[0] == "inconsistent" and (first := past_zero(self, cluster) - open_):
                    cross(self, first)
                    failure = self._choose_cluster(cluster, open_)
                if (
                    failure
                    and failure[0] == "inconsistent"
                    and (more := vanishing_surfaces(self, cluster) - open_)
                ):
                    failure = self._choose_cluster(cluster, open_ | more)
                if failure:
                    return failure
        return None

    def _choose_cluster(self, cluster: tuple[int, ...], open_: set[int]) -> Failure | None:
        at, automata = self.at, self.system.automata
        members = with_tied(self.system, [c for c in cluster if c in open_ or at.z[c] == automata[c].hold])
        self.on_surface[members] = True
        sizes = [len(automata[c].modes) for c in members]
        if math.prod(sizes) > _MAX_CANDIDATES:
            names = ", ".join(automata[c].name for c in members)
            return (
                "inconsistent",
                f"{len(sizes)} coupled components reach their surfaces at once ({names}), too many to solve",
            )
        at.x = self._pinned(members)
        at.x_error = np.where(self.pinned_states(members), UNIT * np.abs(at.x), at.x_error)
        candidates = together(self.system, members, joint_candidates(sizes))
        found = judged_candidates(self, members, candidates, below_limits(self, members), cluster)
        if found.number == NONE and len(found.candidates) < len(candidates):
            keeps = np.zeros(len(members), dtype=np.bool_)
            found = judged_candidates(self, members, candidates, keeps, cluster)
        candidates, verdicts, number = found
        rival = rivals(self, members, candidates, verdicts)
        if len(rival):
            return f"{'' if self.forward else 'backward-'}nonunique", self._say(
                members, rival, _SEVERAL_MOTIONS
            )
        if number == NONUNIQUE:
            left = np.flatnonzero(completed(self, members, found, cluster) != LEAVES)
            if not is_one_motion(self, members, candidates[left]):
                return self._several(members, candidates[left])
            number = int(left[on_its_side(self, members, candidates[left])])
        if number == NONE:
            return refused(self, members, self._say(members, candidates, "no motion is admissible"))
        others = other_outcomes(self, members, candidates, number, open_, cluster)
        if len(others):
            return "nonunique", self._say(members, np.vstack([candidates[number], others]), _SEVERAL_MOTIONS)
        if reason := keeps_nothing(self, members, self.with_modes(members, candidates[number])):
            return "nonunique", self._say(members, candidates[number : number + 1], reason)
        self._enter(members, candidates[number])
        return None

    def _enter(self, members: list[int], modes: np.ndarray) -> None:
        """Set components to the chosen modes."""
        at, automata, source = self.at, self.system.automata, self.at.z.copy()
        fired = [(c, j) for c, j, _ in self.fired_guards() if source[c] >= 0]
        guards = {c: automata[c].guard_names[source[c]][j] for c, j in fired}
        for c, mode in zip(members, modes, strict=True):
            at.z[c] = mode
            if source[c] != mode and source[c] >= 0:
                self.fired[list(automata[c].guards[source[c]])] = False
                self.changes.append(Change(c, guards.get(c, ""), int(source[c]), int(mode), at.x, at.x))

    def _several(self, components: list[int], candidates: np.ndarray) -> tuple[str, str]:
        """Return the status and the message for several possible motions, or for a rate that is not a number."""
        at = self.at
        for modes in candidates:
            lost = rates_without_value(self.system, at.s, at.x, at.p, self.with_modes(components, modes))
            if lost:
                return "step-failure", lost
        return "nonunique", self._say(components, candidates, _SEVERAL_MOTIONS)

    def _pinned(self, components: list[int]) -> np.ndarray:
        """Return the states x, moved so that the surfaces of some components are exactly zero."""
        z = np.maximum(self.at.z, 0)
        for c in components:
            z[c] = self.system.automata[c].hold
        return self.system.project(self.at.s, self.at.x, self.at.p, z)

    def _say(self, components: list[int], candidates: np.ndarray, what: str) -> str:
        automata = self.system.automata
        rows = [
            ", ".join(
                f"{automata[c].name}: {automata[c].modes[m]}" for c, m in zip(components, row, strict=True)
            )
            for row in candidates
        ]
        state = ", ".join(f"{n} = {v:.6g}" for n, v in zip(self.system.names, self.at.x, strict=True))
        return f"{what} at {state}: {'; or '.join(rows)}"
