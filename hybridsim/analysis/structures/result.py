"""This module defines the steady state of a mechanical system, with measures of each coordinate and contact."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any, NoReturn

import numpy as np

from hybridsim.analysis.polynomials.orbit import Orbit
from hybridsim.analysis.steady.by_name import ByName
from hybridsim.analysis.steady.result import SteadyState
from hybridsim.analysis.structures.orbits import orbit_of_contacts, orbit_of_coordinate
from hybridsim.errors import UsageError
from hybridsim.mechanics.declaration.named_values import values_of
from hybridsim.mechanics.declaration.system import MechanicalSystem
from hybridsim.mechanics.series_loop.node_segments import NodeSegments
from hybridsim.mechanics.series_loop.series_trajectory import SeriesTrajectory
from hybridsim.solution import Solution
from hybridsim.solution.run_trajectory import relative_velocity

_SHOWN = 8  # coordinates and contacts in a printed result
_MODES = {0: "stick", 1: "slip+", -1: "slip-"}


class StructureSteadyState(SteadyState):
    """A `SteadyState` of a `MechanicalSystem`, computed from the Taylor series of each coordinate.

    Parameters
    ----------
    run : the motion over one period, or over the last one that was followed.
    kind, multiple, residual, periods, message : see `SteadyState`.
    """

    def __init__(
        self, run: SeriesTrajectory, kind: str, multiple: int, residual: float, periods: int, message: str
    ) -> None:
        self._run = run
        self.kind, self.newton_steps, self.periods, self.message = kind, 0, periods, message
        self.lyapunov, self.residual = math.nan, residual
        is_periodic = kind == "periodic"
        self.period = run.t_end - run.t_start if is_periodic else math.nan
        self.multiple = multiple if is_periodic else 0
        self._summarised = None

    @property
    def model(self) -> MechanicalSystem:  # type: ignore[override]  # a structure has no Model
        """The mechanical system."""
        return self._run.model

    @property
    def _parameters(self) -> dict[str, float]:
        return values_of(self.model)

    @cached_property
    def solution(self) -> Solution:  # type: ignore[override]  # as in the base class
        """The run over one period; if the motion does not repeat, the run over the last period."""
        return Solution(self._run)

    @property
    def start(self) -> dict[str, float]:
        """The states at the beginning of the period, by name; another search accepts them as ``x0``."""
        first = self._run.states(np.array([self._run.t_start]), "+")[0]
        return dict(zip(self._run.names, first.tolist(), strict=True))

    @property
    def _phase(self) -> float:
        return self._run.t_start

    @cached_property
    def _names(self) -> tuple[str, ...]:
        return (*self._run.names, *self._run.quantities)

    @cached_property
    def _contacts(self) -> tuple[str, ...]:
        return tuple(self._run.event_names)

    @cached_property
    def _modes(self) -> tuple[str, ...]:
        return tuple(f"{contact}.{mode}" for contact in self._contacts for mode in _MODES.values())

    @cached_property
    def _orbit(self) -> Orbit:
        """The motion of the contacts over the period, as an orbit."""
        self._require_period()
        return orbit_of_contacts(self._run)

    @cached_property
    def _coordinates(self) -> dict[int, Orbit]:
        return {}

    @cached_property
    def _segments(self) -> NodeSegments:
        return NodeSegments(self._run.run.built.arrays, self._run.run.segments)

    def _orbit_with(self, name: str) -> Orbit:
        if name in self._run.quantities:
            return self._orbit
        self._require_period()
        i = self._run.names.index(name) % self.model.n
        if i not in self._coordinates:
            self._coordinates[i] = orbit_of_coordinate(self._run, self._segments, i)
        return self._coordinates[i]

    def _require_period(self) -> None:
        if not self.success:
            raise UsageError(
                f"the motion is {self.kind}: no single period represents it ({self.message})",
                remedy="raise `max_periods` or `tol`, or use hs.simulate",
            )

    def _each(self, head: str, measure: Any) -> ByName:
        return ByName(lambda: (self._names, frozenset()), measure, "quantity")

    @property
    def too_fast(self) -> tuple[str, ...]:
        """Names of the quantities that vary too fast, or jump too often, to be measured."""
        return tuple(name for name in self._names if name in self._orbit_with(name).too_fast)

    @property
    def dissipated(self) -> ByName:
        """Work of friction over the period, by contact: the integral of the force times the relative velocity."""
        self._require_period()
        orbit = self._orbit
        return ByName(
            lambda: (self._contacts, frozenset()),
            lambda c: orbit.integral(orbit.of(c) * orbit.of(relative_velocity(c))),
            "contact",
        )

    def held_mode(self, contact: str) -> str:
        """Return the name of the stick mode."""
        self._require_period()
        return "stick"

    @cached_property
    def word(self) -> tuple[str, ...]:
        """The mode sequence over the period; modes of several contacts are separated by commas."""
        self._require_period()
        when, contacts, changes = self._run.changes
        modes = [self._run.first_mode(k) for k in range(len(self._contacts))]
        found = [",".join(_MODES[z] for z in modes)]
        for t in np.unique(when):
            for k, mode in zip(contacts[when == t].tolist(), changes[when == t, 1].tolist(), strict=True):
                modes[k] = mode
            found.append(",".join(_MODES[z] for z in modes))
        if len(found) > 1 and found[0] == found[-1]:
            found.pop()
        return tuple(found)

    @property
    def grazing(self) -> None:
        """None, because the guards of a `MechanicalSystem` are not recorded."""

    @property
    def multipliers(self) -> NoReturn:
        """Raise an error, because a run of a `MechanicalSystem` provides no derivatives."""
        self._refuse_derivatives("multipliers")

    def sensitivities(self, parameters: Sequence[str] | None = None) -> NoReturn:
        """Raise an error, because a run of a `MechanicalSystem` provides no derivatives."""
        self._refuse_derivatives("sensitivities")

    def _refuse_derivatives(self, measure: str) -> NoReturn:
        raise UsageError(
            f"{self.model.name} is a MechanicalSystem, whose steady states have no {measure}",
            remedy="use hs.steady_state(system.to_model()) if the contact velocities are independent",
        )

    def __repr__(self) -> str:
        lines = [f"Steady state of {self.model.name}: {self.message}"]
        if self.kind == "periodic":
            lines.append(f"  period {self.period:.15g}")
        if self.success:
            names = self.model.names
            shown = ", ".join(f"{n} {self.amplitude[n]:.9g}" for n in names[:_SHOWN])
            lines.append(f"  amplitudes {shown}" + ", ..." * (len(names) > _SHOWN))
            lines += [
                f"  {c}: {100.0 * self.stick_fraction[c]:.4g} % of the period in stick, "
                f"{self.stops_per_period[c]:g} stops"
                for c in self._contacts[:_SHOWN]
            ]
            lines += [f"  ... ({len(self._contacts)} contacts)"] if len(self._contacts) > _SHOWN else []
        return "\n".join(lines)
