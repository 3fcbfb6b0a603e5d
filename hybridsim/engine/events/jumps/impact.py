"""Resolve impacts at an event: find the contacts that take part, and the states after their impulses."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from hybridsim.engine.events.event_data import EventData
from hybridsim.engine.events.jumps.impulse import MAX_COMBINATIONS, Answer, ImpactProblem, answers, count
from hybridsim.engine.events.jumps.rest_impulses import loaded, stopped
from hybridsim.engine.events.outcome import Change
from hybridsim.engine.series.bounded import UNIT
from hybridsim.model.parts.impact import ROUNDING

# The error of location is rounding, so one Newton correction makes the gap zero within rounding. The second correction
# is for steps that end slightly inside.
CORRECTIONS = 2

# A start or reset may set a gap below zero by this part of the states and of the gap's rates, because it may be a state
# of another run, which has the rounding of that run. The gap is then zero.
_PUT_BELOW = 2.0**-46

Failure = tuple[str, str]


def strike(resolution: EventData, open_: set[int]) -> Failure | None:
    """Compute the impacts at closing gaps; of these contacts, only those at rest afterwards remain in `open_`.

    A contact at zero gap with a velocity of separation is open from now on.
    """
    unilateral = [c for c in open_ if resolution.system.automata[c].is_unilateral]
    if not unilateral:
        return None
    if not resolution.forward:
        names = ", ".join(sorted(resolution.system.automata[c].name for c in unilateral))
        return (
            "backward-nonunique",
            f"the gap of {names} closes, and the past of an impact is not unique",
        )
    has_collided = False
    for cluster in resolution.system.clusters:
        mine = [c for c in cluster if c in unilateral]
        if mine:
            failure, struck = _Collision(resolution, cluster, mine, open_).run()
            if failure:
                return failure
            has_collided = has_collided or struck
    if has_collided:
        resolution.jumped = True
        resolution.take_sides(open_)
    return None


def _surfaces(resolution: EventData) -> tuple[np.ndarray, np.ndarray]:
    """Return the Taylor coefficients of the surfaces, with bounds, at states that are not projected onto surfaces."""
    at, system = resolution.at, resolution.system
    free = at.p.copy()
    free[system.layout.pin_at] = 0.0
    series: Any = system.series(at.s, at.x, free, np.maximum(at.z, 0), at.x_error, at.s_error, at.is_put)
    return series.surfaces, series.surface_bounds


def message_on_restitution(name: str, value: float, speed: float) -> str:
    """Return the error message for a coefficient of restitution outside [0, 1]."""
    where = f"at a speed of approach of {speed:.6g}"
    return f"the restitution of {name} is {value!r} {where}, and must lie between 0 and 1"


class _Collision:
    """One collision of the contacts of a cluster, in which some gaps have reached zero."""

    def __init__(
        self, resolution: EventData, cluster: tuple[int, ...], mine: list[int], open_: set[int]
    ) -> None:
        self.resolution, self.cluster, self.open_ = resolution, cluster, open_
        self.system, self.at = resolution.system, resolution.at
        self.place = {c: k for k, c in enumerate(self.system.surface_of)}
        self.rates = dict.fromkeys(mine, 0.0)

    def run(self) -> tuple[Failure | None, bool]:
        """Compute the impact; return a reason to end the run, or None, and whether there was an impact."""
        failure = self._measure()
        if failure:
            return failure, False
        self._join()
        if all(rate >= 0.0 for rate in self.rates.values()):
            for c, rate in self.rates.items():
                if rate > 0.0:
                    self._opens(c)
            return None, False
        return self._collide(), True

    def _measure(self) -> Failure | None:
        """Measure the rates of the gaps, and remove contacts whose gaps are open."""
        resolution, at, automata = self.resolution, self.at, self.system.automata
        if not resolution.jumped and all(at.z[c] == automata[c].hold for c in self.rates):
            return None
        values, bounds = self._surfaces
        for c in list(self.rates):
            row, bound = values[self.place[c]], bounds[self.place[c]]
            size = max(np.abs(at.x).max(), np.abs(row[:3]).max()) if at.is_put else 0.0
            located = (
                at.z[c] == automata[c].above and resolution.fired[automata[c].guards[automata[c].above][0]]
            )
            if not located and row[0] < -bound[0] - _PUT_BELOW * size:
                state = ", ".join(f"{n} = {v:.6g}" for n, v in zip(self.system.names, at.x, strict=True))
                return (
                    "inconsistent",
                    f"the gap of {automata[c].name} is {row[0]:.6g}, below zero, at {state}",
                )
            if not located and row[0] > bound[0]:
                self._opens(c)
                del self.rates[c]
                continue
            if abs(row[1]) > bound[1]:
                self.rates[c] = float(row[1])
        return None

    @cached_property
    def _surfaces(self) -> tuple[np.ndarray, np.ndarray]:
        return _surfaces(self.resolution)

    def _join(self) -> None:
        """Add the friction contacts at zero velocity to the collision, because their modes depend on normal forces."""
        values, bounds = self._surfaces
        for c in self.cluster:
            k = self.place[c]
            if not self.system.automata[c].is_unilateral and abs(values[k, 0]) <= bounds[k, 0]:
                self.open_.add(c)

    def _opens(self, c: int) -> None:
        """Open a contact whose gap is exactly zero at this instant."""
        automaton = self.system.automata[c]
        if self.at.z[c] == automaton.hold:
            self._changes(c, "impact", automaton.above)
        self.at.z[c] = automaton.above
        self.resolution.fired[automaton.guards[automaton.above][0]] = True
        self.resolution.on_surface[c] = False
        self.open_.discard(c)

    def _changes(self, c: int, guard: str, target: int) -> None:
        source = int(self.at.z[c])
        self.resolution.changes.append(Change(c, guard, source, target, self.at.x, self.at.x))
        self.at.z[c] = target

    def _collide(self) -> Failure | None:
        at, system, automata = self.at, self.system, self.system.automata
        held = [
            c
            for c in self.cluster
            if automata[c].is_unilateral and at.z[c] == automata[c].hold and c not in self.rates
        ]
        normal = sorted([*self.rates, *held])
        modes = np.maximum(at.z, 0)
        slopes, changes, loads = system.impulses(at.s, at.x, at.p, modes)
        normal_rows = [self.place[c] for c in normal]
        rubbing = [c for c in self.cluster if loads[:, self.place[c]][:, normal_rows].any()]
        members = [*normal, *rubbing]
        rows = [self.place[c] for c in members]
        before = np.array([self.rates.get(c, 0.0) for c in normal] + [0.0] * len(rubbing))
        before[len(normal) :] = self._velocities(rubbing)
        speeds = np.zeros(len(system.surface_of))
        speeds[normal_rows] = np.maximum(-before[: len(normal)], 0.0)
        restitution = system.restitutions(at.s, at.x, at.p, modes, speeds)[normal_rows]
        for c, value, speed in zip(normal, restitution.tolist(), speeds[normal_rows].tolist(), strict=True):
            if not -ROUNDING <= value <= 1.0 + ROUNDING:
                return "inconsistent", message_on_restitution(automata[c].name, value, speed)
        restitution = np.clip(restitution, 0.0, 1.0)
        names = ", ".join(automata[c].name for c in members)
        problem = ImpactProblem(
            slopes[rows] @ changes[rows].T,
            before,
            restitution,
            *(loads[side][np.ix_(rows[len(normal) :], normal_rows)] for side in (0, 1)),
        )
        if count(problem) > MAX_COMBINATIONS:
            return (
                "inconsistent",
                f"{len(members)} contacts take part in one impact ({names}), too many to solve",
            )
        found = answers(problem)
        if len(found) != 1:
            what = "several outcomes" if found else "no outcome"
            motion = ", ".join(f"{value:.6g}" for value in before)
            status = "nonunique" if found else "inconsistent"
            return status, f"an impact of {names} with the rates {motion} has {what}"
        among = (slopes[rows], changes[rows], loads[:, rows][:, :, rows])
        self._apply(members, found[0], restitution, *among)
        if found[0].reduced:
            self.resolution.warnings.append(
                f"an impact of {names} would gain energy by Newton's law, so its rebound was reduced"
            )
        return None

    def _velocities(self, rubbing: list[int]) -> list[float]:
        """Return the relative velocities before the impact."""
        values, bounds = self._surfaces
        rows = [self.place[c] for c in rubbing]
        return [0.0 if abs(values[k, 0]) <= bounds[k, 0] else float(values[k, 0]) for k in rows]

    def _apply(
        self,
        members: list[int],
        answer: Answer,
        restitution: np.ndarray,
        slopes: np.ndarray,
        changes: np.ndarray,
        loads: np.ndarray,
    ) -> None:
        at, automata, resolution = self.at, self.system.automata, self.resolution
        normal = [c for c in members if automata[c].is_unilateral]
        shares = answer.impulses[:, None] * changes
        moved = changes.any(axis=0)
        x = np.where(moved, at.x + shares.sum(axis=0), self._on_gaps(normal))
        sizes = np.abs(at.x) + np.abs(shares).sum(axis=0)
        error = at.x_error + 8.0 * UNIT * sizes + np.abs(changes).T @ self._uncertain(answer)
        # states evaluated from gaps are as accurate as the gaps
        unchanged_error = np.where(resolution.pinned_states(normal), 0.0, at.x_error)
        at.x, at.x_error = x, np.where(moved, error, np.maximum(unchanged_error, UNIT * np.abs(x)))
        # a rate that is zero within rounding is the end of an accumulation
        is_lost = np.abs(answer.after) <= np.abs(slopes) @ at.x_error
        if len(normal) == 1 and 0.0 < restitution[0] < 1.0:
            is_lost[0] = False  # it bounces; `hidden_bounces` finds the end
        if is_lost.any():
            ends = answer.zero | is_lost
            sliding = np.where(ends, 0.0, np.sign(answer.after))
            sliding[: len(normal)] = 0.0
            among = loaded(changes, loads, sliding)
            at.x = stopped(at.x, np.where(is_lost, answer.after, 0.0)[ends], slopes[ends], among[ends])
        for i, c in enumerate(members):
            automaton, is_zero = automata[c], bool(answer.zero[i] or is_lost[i])
            resolution.on_surface[c] = is_zero
            if not automaton.is_unilateral:
                continue
            if at.z[c] < 0:
                at.z[c] = automaton.above
            if is_zero:
                if at.z[c] != automaton.hold:
                    self._changes(c, "gap", automaton.hold)
                self.open_.add(c)
            else:
                if at.z[c] == automaton.above and answer.impulses[i] > 0.0:
                    self._changes(c, "gap", automaton.above)
                self._opens(c)

    def _on_gaps(self, normal: list[int]) -> np.ndarray:
        """Return the state with some gaps set to zero, at unchanged velocities.

        A gap that is linear in a position determines it. Other gaps move the positions along their gradients, by at
        most the error of locating the impact. A holding mode would also make the rates of the gaps zero.
        """
        at, system = self.at, self.system
        z = np.maximum(at.z, 0)
        # other holding modes would use velocities from before the impact, so they are opened for the projection
        for c, automaton in enumerate(system.automata):
            if automaton.has_surface and z[c] == automaton.hold:
                z[c] = automaton.above
        z[normal] = [system.automata[c].hold for c in normal]
        x = system.project(at.s, at.x, at.p, z)
        projected = [c for c in normal if c in system.projected]
        if not projected:
            return x
        moving = sorted({i for held in system.projected.values() for i in held})
        x[moving] = at.x[moving]
        free = at.p.copy()
        free[system.layout.pin_at] = 0.0
        rows = [self.place[c] for c in projected]
        for _ in range(CORRECTIONS):
            gaps = system.series(at.s, x, free, z, at.x_error, at.s_error, at.is_put).surfaces[rows, 0]
            slopes = system.gap_slopes(at.s, x, free, z)[rows]
            if not (np.isfinite(gaps).all() and np.isfinite(slopes).all()):
                return x
            x = x - np.linalg.lstsq(slopes, gaps, rcond=None)[0]
        return x

    def _uncertain(self, answer: Answer) -> np.ndarray:
        """Return bounds of the rounding errors of the impulses."""
        return 8.0 * UNIT * len(answer.impulses) * np.abs(answer.impulses)
