"""This module measures a periodic orbit: amplitudes, energies, harmonics, friction work, stick fractions."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hybridsim.analysis.polynomials.orbit import Orbit
from hybridsim.analysis.polynomials.resolving import orbit_of
from hybridsim.analysis.steady.by_name import ByName
from hybridsim.arguments import cannot_be, known_name
from hybridsim.expr import evaluate
from hybridsim.expr.grammar import TIME
from hybridsim.solution import Solution
from hybridsim.solution.integrals.impulsive import impulse_of, is_struck

MOST_HARMONICS = 100_000  # a segment cannot resolve a higher one
_ROUNDING = 1e-10  # relative to a guard's largest value; a smaller value is rounding after an event


class Grazing(NamedTuple):
    """The smallest value of a guard that does not reach zero, and its ratio to the guard's maximum."""

    guard: str
    t: float
    value: float
    relative: float


class Measures:
    """Measures of one period of a motion; `solution` is the run over this period."""

    solution: Solution

    @cached_property
    def _orbit(self) -> Orbit:
        return orbit_of(self.solution)

    @property
    def _phase(self) -> float:
        """The time at which the orbit begins, on the time axis of the forcing."""
        return 0.0

    @cached_property
    def _names(self) -> tuple[str, ...]:
        return tuple(n for n in self._orbit.names if not n.startswith(("guard ", "velocity of ")))

    @cached_property
    def _contacts(self) -> tuple[str, ...]:
        system = self.solution._system
        return tuple(system.automata[c].name for c in system.surface_of)

    def _each(self, head: str, measure: Callable[[str], float]) -> ByName:
        return ByName(lambda: (self._names, self._orbit.too_fast), measure, "quantity", self._summed(head))

    def _of_contacts(self, head: str, measure: Callable[[str], float]) -> ByName:
        return ByName(lambda: (self._contacts, frozenset()), measure, "contact", self._summed(head))

    def _summed(self, head: str) -> dict[str, float]:
        """Return the values of one measure that a summary of the motion already contains."""
        return {}

    @property
    def too_fast(self) -> tuple[str, ...]:
        """Names of the quantities that vary too fast, or jump too often, to be measured."""
        return tuple(name for name in self._names if name in self._orbit.too_fast)

    def _orbit_with(self, name: str) -> Orbit:
        """Return an orbit that contains the given quantity."""
        return self._orbit

    def _extreme(self, name: str, side: int) -> float:
        orbit = self._orbit_with(name)
        return float(orbit.extremes[side][orbit.column(name)])

    @property
    def minimum(self) -> ByName:
        """Least value of each quantity over the period."""
        return self._each("minimum", lambda q: self._extreme(q, 0))

    @property
    def maximum(self) -> ByName:
        """Greatest value of each quantity over the period."""
        return self._each("maximum", lambda q: self._extreme(q, 1))

    @property
    def amplitude(self) -> ByName:
        """(max - min)/2 of each quantity, from its dense output."""
        return self._each("amplitude", lambda q: 0.5 * (self._extreme(q, 1) - self._extreme(q, 0)))

    @property
    def peak(self) -> ByName:
        """Largest absolute value of each quantity, from its dense output."""
        return self._each("peak", lambda q: max(abs(self._extreme(q, 0)), abs(self._extreme(q, 1))))

    @property
    def mean(self) -> ByName:
        """Mean of each quantity over the period."""
        return self._each("mean", lambda q: self._orbit_with(q).mean(q))

    @property
    def energy(self) -> ByName:
        """Integral of q^2 over the period (He et al. 2026, eq. 5)."""
        return self._each("energy", lambda q: self._orbit_with(q).energy(q))

    @property
    def rms(self) -> ByName:
        """Root of the mean square of each quantity over the period."""
        return self._each("rms", lambda q: math.sqrt(self.energy[q] / self._orbit_with(q).duration))

    def harmonic(self, name: str, k: int = 1) -> complex:
        """Return the amplitude c_k of q(t) = c_0 + sum of Re(c_k exp(2 pi i k t/T)), with the forcing's time t.

        It is an integral over the segments, without sampling or aliasing.
        """
        known_name(name, self._names, "the steady state has no quantity", "quantities")
        if not isinstance(k, int) or not 0 <= k <= MOST_HARMONICS:
            raise cannot_be(
                "k", k, "use 0 for the mean, 1 for the fundamental, or 2, 3, ... for higher harmonics"
            )
        frequency = 2.0 * math.pi * k / self._orbit_with(name).duration
        found = self._orbit_with(name).harmonic(name, frequency)
        return found * cmath.exp(-1j * frequency * self._phase) if self._phase else found

    @property
    def dissipated(self) -> ByName:
        """Work of friction over the period, by contact: the integral of the force times the relative velocity."""
        remember = [c.name for c in self.solution.model.contacts if c.name not in self._contacts]
        contacts, too_fast = (*self._contacts, *remember), self._orbit.too_fast
        return ByName(
            lambda: (contacts, frozenset(c for c in contacts if {c, f"velocity of {c}"} & too_fast)),
            lambda c: self._orbit.integral(self._orbit.of(c) * self._velocity(c)),
            "contact",
        )

    def _velocity(self, contact: str) -> np.ndarray:
        """Return the relative velocity of a contact at the Gauss points of the orbit."""
        orbit, model = self._orbit, self.solution.model
        if f"velocity of {contact}" in orbit.names:
            return orbit.of(f"velocity of {contact}")
        velocity = next(c.velocity for c in model.contacts if c.name == contact)
        if velocity.text in orbit.names:
            return orbit.of(velocity.text)
        known, times = model.parameter_values(), self.solution.t_start + orbit.times
        rows = {name: orbit.of(name).ravel() for name in velocity.names & set(orbit.names)}
        rows |= {TIME: times.ravel()} if TIME in velocity.names else {}
        found = [
            evaluate(velocity, known | {name: float(row[k]) for name, row in rows.items()})
            for k in range(times.size)
        ]
        return np.reshape(found, times.shape)

    @property
    def stick_fraction(self) -> ByName:
        """Fraction of the period that each contact spends in stick."""
        return self._of_contacts("stick_fraction", self._stuck)

    def _stuck(self, contact: str) -> float:
        hold = self.held_mode(contact)
        spent = sum(i.t1 - i.t0 for i in self.solution.modes[contact] if i.mode == hold)
        return spent / (self.solution.t_end - self.solution.t_start)

    @property
    def mode_fraction(self) -> ByName:
        """Fraction of the period that each component spends in each mode, by names such as "f.slip+"."""
        return ByName(
            lambda: (self._modes, frozenset()), self._spent_in, "mode", self._summed("mode_fraction")
        )

    @cached_property
    def _modes(self) -> tuple[str, ...]:
        declared = self.solution._system.declared
        return tuple(f"{automaton.name}.{mode}" for automaton in declared for mode in automaton.modes)

    def _spent_in(self, name: str) -> float:
        component, _, mode = name.rpartition(".")
        spent = sum(i.t1 - i.t0 for i in self.solution.modes[component] if i.mode == mode)
        return spent / (self.solution.t_end - self.solution.t_start)

    def held_mode(self, contact: str) -> str:
        """Return the name of the stick mode, or of the mode in which the motion follows a switching surface."""
        automata = {a.name: a for a in self.solution._system.automata if a.has_surface}
        automaton = automata[
            known_name(contact, list(automata), "the steady state has no contact", "contacts")
        ]
        return str(automaton.modes[automaton.hold])

    @property
    def stops_per_period(self) -> ByName:
        """Number of stops of each contact per period."""
        return self._of_contacts("stops_per_period", self._stops)

    def _stops(self, contact: str) -> float:
        """Count the stick intervals. An interval across the end counts once, and permanent stick does not count."""
        hold, intervals = (
            self.held_mode(contact),
            [i.mode for i in self.solution.modes[contact] if i.t1 > i.t0],
        )
        count = sum(mode == hold for mode in intervals)
        return float(count - (intervals[0] == hold == intervals[-1]))

    @property
    def impacts(self) -> ByName:
        """Number of collisions of each impact over the period; see `hybridsim.Impact`."""
        events = self.solution.events
        return self._of_impacts(lambda p: float(sum(e.component == p and is_struck(e) for e in events)))

    @property
    def impulse(self) -> ByName:
        """Sum of the impulses of each impact over the period, in the unit of its force times that of t."""
        return self._of_impacts(lambda p: impulse_of(self.solution, p))

    def _of_impacts(self, measure: Callable[[str], float]) -> ByName:
        names = tuple(impact.name for impact in self.solution.model.impacts)
        return ByName(lambda: (names, frozenset()), measure, "impact")

    @cached_property
    def word(self) -> tuple[str, ...]:
        """The mode sequence over the period; modes of several components are separated by commas."""
        return word_of(self.solution)

    @cached_property
    def grazing(self) -> Grazing | None:
        """The guard that comes closest to zero without reaching it, or None if there is no such guard.

        Left out are a guard at an event that makes it zero, points of tables, and guards that vary too fast.
        """
        orbit, solution, system = self._orbit, self.solution, self.solution._system
        tables = {name for contact in solution.model.contacts for name in contact.table_variables}
        guards = [name for name in orbit.names if name.startswith("guard ")]
        largest = {name: abs(orbit.of(name)).max() for name in guards if name not in orbit.too_fast}
        found: list[Grazing] = []
        for quantity, piece, t, value, is_minimum in zip(*orbit.turns, strict=True):
            name = orbit.names[quantity]
            if name not in largest or not is_minimum or value <= _ROUNDING * largest[name]:
                continue
            z = solution._segments[int(orbit.segments[piece])].z
            guard = int(name.removeprefix("guard "))
            if system.active(z)[guard] and system.automata[system.owner[guard]].name not in tables:
                title = system.guard_title(guard, z)
                relative = float(value / largest[name])
                found.append(Grazing(title, solution.t_start + float(t), float(value), relative))
        return min(found, key=lambda g: g.relative, default=None)


def word_of(solution: Solution) -> tuple[str, ...]:
    """Return the mode sequence of a run, without the last mode if it equals the first mode."""
    names = [a.modes for a in solution._system.declared]
    found: list[str] = []
    for z, (first, last) in zip(solution._segments.modes(), solution._segments.spans(), strict=True):
        here = ",".join(modes[m] for modes, m in zip(names, z[: len(names)].tolist(), strict=True))
        if last > first and (not found or found[-1] != here):
            found.append(here)
    if len(found) > 1 and found[0] == found[-1]:
        found.pop()
    return tuple(found)
