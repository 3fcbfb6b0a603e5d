"""This module defines the result of `steady_state`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from hybridsim.analysis.compare.comparison_request import checked_names
from hybridsim.analysis.polynomials.orbit import Orbit as PeriodOrbit
from hybridsim.analysis.polynomials.resolving import orbit_of
from hybridsim.analysis.steady.derivatives import SteadySensitivities, steady_sensitivities
from hybridsim.analysis.steady.measures import Measures
from hybridsim.analysis.steady.motion import Motion
from hybridsim.analysis.steady.period_readings import Summarised, summed
from hybridsim.analysis.steady.shooting import Orbit, multipliers, rates_at_end
from hybridsim.analysis.variations.sensitivities import derivatives
from hybridsim.arguments import whole_number
from hybridsim.calls import refusing
from hybridsim.engine.system.system_cache import system_of
from hybridsim.errors import HybridsimError, UsageError
from hybridsim.files import fields_of
from hybridsim.model import Model
from hybridsim.model.parts.remedies import remedy_for_parameter
from hybridsim.presentation.readable import Readable
from hybridsim.solution import Solution

_NEUTRAL = 1e-9
_MOST_LISTED = 10_000  # harmonics per quantity in a record


class SteadyState(Readable, Measures):
    """The motion that a model reaches after its transient has decayed, with its measures.

    Attributes
    ----------
    kind : str
        "periodic", "equilibrium", "quasi-periodic", "chaotic" or "not settled".
    success : bool
        Whether the motion is periodic or an equilibrium, and so has measures.
    period, multiple : float, int
        Time after which the motion repeats; the same in periods of the forcing (without forcing, in passages
        of the section): n for a period-n motion.
    residual : float
        Largest change of a state over the period, relative to its largest size.
    newton_steps, periods : int
        The effort: steps of Newton's method, and periods that were followed.
    lyapunov : float
        Largest Lyapunov exponent per unit of time, for a motion that does not repeat.
    message : str
        One sentence about how it was found.

    Other Parameters
    ----------------
    motion, kind, orbit, is_free, newton_steps, periods, message, summarised : object
        Passed on by `steady_state`; do not construct it by hand.

    Examples
    --------
    >>> import hybridsim as hs
    >>> steady = hs.steady_state("dfcs")
    >>> steady.success, steady.multiple, f"{steady.period:.6f}"  # 2*pi/omega
    (True, 1, '0.014810')
    """

    def __init__(
        self,
        motion: Motion,
        kind: str,
        orbit: Orbit | None,
        is_free: bool,
        newton_steps: int,
        periods: int,
        message: str,
        summarised: Summarised | None = None,
    ) -> None:
        self._summarised = summarised
        self.kind, self.newton_steps, self.periods, self.message = kind, newton_steps, periods, message
        self.lyapunov = math.nan
        self._motion, self._closed, self._is_free = motion, orbit, is_free
        self.period = orbit.period if orbit is not None and kind == "periodic" else math.nan
        self.multiple = orbit.multiple if orbit is not None and kind == "periodic" else 0
        self.residual = orbit.residual if orbit is not None else math.nan

    @property
    def model(self) -> Model:
        """The model with its parameters."""
        return self._motion.model

    @property
    def _parameters(self) -> dict[str, float]:
        return self.model.parameter_values()

    @property
    def success(self) -> bool:
        """Whether the steady motion is periodic or an equilibrium."""
        return self.kind in ("periodic", "equilibrium")

    @property
    def status(self) -> str:
        """The kind of motion, such as "periodic" or "equilibrium"."""
        return self.kind

    @cached_property
    def solution(self) -> Solution:  # type: ignore[override]  # computed on demand
        """The run over one period, or over a part of the motion if the motion has no period.

        With forcing it begins at t = 0, or between two events if an event is there, so that it contains each
        event once.
        """
        if self._closed is None:
            raise UsageError(f"no trajectory of this motion is stored: {self.message}")
        return self._motion.run(self._closed.start, self._closed.period)

    @property
    def _phase(self) -> float:
        return 0.0 if self._closed is None else self._closed.start.at

    def _summed(self, head: str) -> dict[str, float]:
        return {} if self._summarised is None else summed(head, self._summarised, system_of(self.model))

    @cached_property
    def _orbit(self) -> PeriodOrbit:
        if not self.success:
            raise UsageError(
                f"the motion is {self.kind}: no single period represents it ({self.message})",
                remedy="use hs.simulate, or hs.bifurcation to sample the motion",
            )
        return orbit_of(self.solution)

    @cached_property
    def multipliers(self) -> np.ndarray:
        """Floquet multipliers, largest first. For an unforced orbit, the trivial multiplier 1 is left out.

        Each stick phase of a contact reduces the rank by one, and makes one multiplier exactly zero. A motion along
        which a guard or surface stays zero while its two sides part has none.
        """
        if not self.success:
            raise UsageError(
                f"the motion is {self.kind}: a motion without a period has no multipliers",
                remedy="use the attribute `lyapunov` instead",
            )
        rates = rates_at_end(self.solution) if self._is_free else None
        found = derivatives(self.solution, ())
        if found.warnings:
            raise UsageError(
                f"the motion has no multipliers: {found.warnings[0].partition(',')[0]}, and its two sides differ later",
                remedy="use other parameters, or hs.simulate from starts on both sides",
            )
        return multipliers(found.by_start, rates)

    @property
    def stable(self) -> bool:
        """Whether all multipliers are inside the unit circle, or on it within 100 rtol."""
        return bool((np.abs(self.multipliers) <= 1.0 + max(_NEUTRAL, 100.0 * self._motion.rtol)).all())

    @refusing
    def sensitivities(self, parameters: Sequence[str] | None = None) -> SteadySensitivities:
        """Compute derivatives of the periodic motion, its period and its measures with respect to parameters.

        ::

            (I - M) dx = Phi_p dp + f dT

        M is the monodromy matrix, Phi_p the derivative of the period map by the parameters, f the rates at the end and
        dT the change of the period. It is known with forcing. Without forcing it follows from f . dx = 0.

        Parameters
        ----------
        parameters : sequence of str, optional
            Names of the parameters; by default all.

        Returns
        -------
        SteadySensitivities
            Derivatives of the start and the period. Its method ``of("amplitude", "x")`` differentiates readings.

        Raises
        ------
        UsageError
            For a motion without a period, a multiplier 1, a motion that touches a guard without an event, or
            parameters that change several periods of the forcing by different factors.

        Examples
        --------
        >>> import hybridsim as hs
        >>> steady = hs.steady_state("dfcs")
        >>> steady.sensitivities(["F0"]).of("amplitude", "x").by_parameter.shape
        (1,)
        """
        known = [p.name for p in self.model.parameters]
        chosen = known if parameters is None else checked_names(parameters, "parameters")
        for name in chosen:
            if name not in known:
                raise UsageError(
                    f"model {self.model.name} has no parameter {name!r}",
                    remedy=remedy_for_parameter(self.model, name),
                )
        return steady_sensitivities(
            self.solution, self._orbit, chosen, self.multipliers, self._is_free, self.kind == "equilibrium"
        )

    def to_dict(self, harmonics: int = 5) -> dict[str, Any]:
        """Return all results as plain Python values, with harmonics up to a given order and their phases in radians.

        If the motion has no multipliers, ``multipliers`` and ``stable`` are None, and ``no_multipliers`` gives the
        reason.
        """
        harmonics = whole_number(harmonics, "harmonics", 0, _MOST_LISTED)
        record: dict[str, Any] = {
            "model": self.model.name,
            "parameters": self._parameters,
            **fields_of(self, "kind", "message", "period", "multiple"),
            **fields_of(self, "residual", "newton_steps", "periods", "lyapunov"),
        }
        if not self.success:
            return record
        of_quantities = ("amplitude", "peak", "minimum", "maximum", "mean", "energy")
        of_contacts = ("dissipated", "stick_fraction", "stops_per_period")
        record |= {key: dict(getattr(self, key)) for key in (*of_quantities, *of_contacts)}
        record["harmonics"] = {
            name: [
                {"amplitude": abs(c), "phase": float(np.angle(c))}
                for c in (self.harmonic(name, k) for k in range(harmonics + 1))
            ]
            for name in self.amplitude
        }
        record["too_fast"] = list(self.too_fast)
        record["word"] = list(self.word)
        try:
            record["multipliers"] = [[float(m.real), float(m.imag)] for m in self.multipliers]
            record["stable"], record["no_multipliers"] = self.stable, ""
        except HybridsimError as reason:  # the motion itself is known
            record["multipliers"] = record["stable"] = None
            record["no_multipliers"] = reason.message
        record["grazing"] = None if self.grazing is None else self.grazing._asdict()
        return record

    def plot(self, *quantities: str) -> Any:
        """Draw quantities over the period, and the modes under them; see `hybridsim.plot.time_history`.

        Without names it draws the first four states, and the first four outputs. It returns the axes;
        ``hybridsim.plot.save`` writes them to a file. A motion without a stored run raises `UsageError`.
        """
        return self.solution.plot(*quantities)

    def __repr__(self) -> str:
        lines = [f"Steady state of {self.model.name}: {self.message}"]
        if self.success:
            names = self._motion.names
            lines.append("  amplitudes " + ", ".join(f"{n} {self.amplitude[n]:.9g}" for n in names))
            lines += [
                f"  {c}: {100.0 * self.stick_fraction[c]:.4g} % of the period in {self.held_mode(c)}, "
                f"{self.stops_per_period[c]:g} stops"
                for c in self._contacts
            ]
        if self.kind == "periodic":
            lines.insert(1, f"  period {self.period:.15g}, modes {' '.join(self.word)}")
        return "\n".join(lines)
