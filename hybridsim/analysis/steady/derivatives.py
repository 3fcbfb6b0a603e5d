"""This module computes derivatives of a periodic motion with respect to parameters, by the implicit function theorem.

The motion starts at x and repeats after its period T, so that Phi(T, x, p) = x. With the monodromy matrix M, the
derivative Phi_p of the end by parameters, and the rates f at the end,

    (I - M) dx = Phi_p dp + f dT.

Forcing sets the period: dT is the derivative of the forcing's period. Without forcing dT is unknown, and the start is
kept on a plane across the flow, f . dx = 0. (M. di Bernardo et al., Piecewise-smooth Dynamical Systems, Springer 2008,
section 2.5; R. Seydel, Practical Bifurcation and Stability Analysis, 3rd ed., Springer 2010, section 7.5)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from hybridsim.analysis.polynomials.orbit import Orbit
from hybridsim.analysis.steady.shooting import rates_at_end
from hybridsim.analysis.variations.both_sides import BothSides
from hybridsim.analysis.variations.directions import Directions
from hybridsim.analysis.variations.over_time import OverTime
from hybridsim.analysis.variations.readings.of_run import Readings, quantities_of
from hybridsim.analysis.variations.refused import refuse
from hybridsim.analysis.variations.sensitivities import directions_by
from hybridsim.analysis.variations.values.parameters import expression_slope
from hybridsim.analysis.variations.values.vector_slopes import VectorSlopes
from hybridsim.calls import refusing
from hybridsim.engine.system.system import System
from hybridsim.errors import UsageError
from hybridsim.expr import evaluate
from hybridsim.expr.grammar import TIME
from hybridsim.presentation.readable import Readable
from hybridsim.solution import Solution

_NEUTRAL = 1e-6  # a multiplier that is closer to 1 leaves the motion undetermined
_TOUCHES = 1e-9  # of its largest value: a guard with a smaller minimum touches zero
_ASIDE = 1e-2  # of a segment: a minimum closer to an end belongs to the event there
_ONCE = "use an output that has its extreme value once in a period, and no jump at the start of the period"
_ALIKE = 1e-9  # relative changes of the periods of the forcing that differ by less are equal


@dataclass(frozen=True)
class SteadyReading(Readable):
    """A measure of a periodic motion, such as an amplitude, with its derivatives with respect to parameters.

    Parameters
    ----------
    name : str
        The reading and its quantities, such as "amplitude of x".
    value : float
        The reading itself.
    by_parameter : array
        (P,) derivatives with respect to the chosen parameters.
    """

    name: str
    value: float
    by_parameter: np.ndarray

    def __repr__(self) -> str:
        return f"Derivatives of the {self.name}, {self.value:.9g}: {self.by_parameter}"


@dataclass(frozen=True)
class SteadySensitivities(Readable):
    """The derivatives of a periodic motion, its period and its measures with respect to parameters.

    Parameters
    ----------
    states, parameters : tuple of str
        Names of the n states and d discrete states, and of the P chosen parameters.
    start_by_parameter : array
        (n + d, P) derivatives of the state at the start of the period, `SteadyState.solution`, at a fixed time. Without
        forcing the start is kept on a plane across the flow.
    period_by_parameter : array
        (P,) derivatives of the period.

    Examples
    --------
    >>> import hybridsim as hs
    >>> found = hs.steady_state("dfcs").sensitivities(["F0", "omega"])
    >>> found.of("amplitude", "x").by_parameter.shape
    (2,)
    """

    states: tuple[str, ...]
    parameters: tuple[str, ...]
    start_by_parameter: np.ndarray
    period_by_parameter: np.ndarray
    _over_time: OverTime = field(repr=False, compare=False)
    _is_free: bool = field(repr=False, compare=False)

    @refusing
    def of(self, reading: str, *quantities: str) -> SteadyReading:
        """Return a measure of one period, with its derivatives with respect to parameters; see `Sensitivities.of`.

        Parameters
        ----------
        reading : str
            "minimum", "maximum", "amplitude", "integral" or "mean".
        *quantities : str
            Name of a state or quantity. An integral and a mean accept several, of which they take the product.

        Returns
        -------
        SteadyReading
            The value and ``by_parameter`` (P,).

        Raises
        ------
        UsageError
            As `Sensitivities.of`.
        """
        names = quantities_of(reading, quantities)
        if TIME in names:
            raise UsageError(
                "the time t cannot be measured in a periodic motion, because t does not repeat",
                remedy="use periodic quantities",
            )
        over = self._over_time
        over.require(names)
        solution = over.solution
        # With forcing, the end of the period is its start one period later, for which an extreme value counts once.
        # Without, the start is on a plane across the flow, and an event there moves by an unknown time.
        end_shift = None if self._is_free else self.period_by_parameter
        readings = Readings(over, solution.t_start, solution.t_end, self.parameters, end_shift, _ONCE)
        title, length = f"{reading} of {' * '.join(names)}", solution.t_end - solution.t_start
        if reading not in ("integral", "mean"):
            return SteadyReading(title, *readings.of(reading, names))
        value, slopes = readings.of("integral", names)
        slopes = slopes + readings.at_end(names) * self.period_by_parameter  # the end of the span moves
        if reading == "mean":
            value, slopes = value / length, (slopes - value / length * self.period_by_parameter) / length
        return SteadyReading(title, value, slopes)

    def __repr__(self) -> str:
        rows = zip(self.parameters, self.period_by_parameter.tolist(), strict=True)
        return "Sensitivities of a periodic motion: " + ", ".join(f"dT/d{n} = {v:.6g}" for n, v in rows)


def steady_sensitivities(
    solution: Solution,
    orbit: Orbit,
    parameters: Sequence[str],
    multipliers: np.ndarray,
    is_free: bool,
    rests: bool,
) -> SteadySensitivities:
    """Return the derivatives of a periodic motion or an equilibrium with respect to parameters.

    solution, orbit : the run over one period. is_free : without forcing. rests : at an equilibrium.
    """
    refuse(solution)
    _refuse_grazing(solution, orbit)
    system = solution._system
    near = np.abs(multipliers - 1.0)
    if len(near) and near.min() <= _NEUTRAL:
        raise UsageError(
            f"the motion has the multiplier {multipliers[np.argmin(near)]:.9g}, which is too close to 1, so the motion "
            "has no derivatives with respect to the parameters",
            remedy="use other parameters, or hs.sensitivities for a run from a fixed start",
        )
    states = (*solution.names, *(q.name for q in system.model.discrete))
    directions = directions_by(solution, parameters, states, states)
    over = OverTime(solution, directions, BothSides)
    end, count = over.at_end(), len(states)
    if not np.isfinite(end).all():
        raise UsageError(
            "the motion has no derivatives: " + "; ".join(name for name, _ in over.differing()),
            remedy="use other parameters, at which the function is not exactly zero",
        )
    monodromy, by = end[:, :count], end[:, count:]
    rates = np.append(rates_at_end(solution), np.zeros(count - system.n))
    slopes = directions.parameters[:, count:]
    if rests:
        period = np.zeros(len(parameters))
        start = np.linalg.solve(np.eye(count) - monodromy, by)
    elif is_free:
        start, period = _free(monodromy, by, rates)
    else:
        period = (solution.t_end - solution.t_start) * _relative_periods(system, slopes, parameters, solution)
        start = np.linalg.solve(np.eye(count) - monodromy, by + np.outer(rates, period))
    n = system.n
    moved = OverTime(solution, Directions(start[:n], start[n:], slopes), BothSides)
    return SteadySensitivities(states, tuple(parameters), start, period, moved, is_free)


def _free(monodromy: np.ndarray, by: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives of start and period of an orbit without forcing, with respect to P parameters."""
    count = len(rates)
    system = np.zeros((count + 1, count + 1))
    system[:count, :count] = np.eye(count) - monodromy
    system[:count, count], system[count, :count] = -rates, rates / np.linalg.norm(rates)
    found = np.linalg.solve(system, np.concatenate([by, np.zeros((1, by.shape[1]))]))
    return found[:count], found[count]


def _relative_periods(
    system: System, slopes: np.ndarray, parameters: Sequence[str], solution: Solution
) -> np.ndarray:
    """Return the relative derivatives (P,) of the forcing's period with respect to the parameters."""
    by_name = {p.name: row for p, row in zip(system.model.parameters, slopes, strict=True)}
    rates = VectorSlopes(system, solution._segments[0].origin).rates @ slopes
    found = [-row / rate for row, rate in zip(rates, system.rates.tolist(), strict=True) if rate != 0.0]
    periods = [each.period for each in system.model.inputs] + [each.period for each in system.model.schedules]
    for period in filter(None, periods):
        slope = expression_slope(period, system.values, by_name, len(parameters))
        found.append(slope / evaluate(period, system.values))
    if not found:
        raise UsageError(
            "the period of the motion was given as a number, so the derivatives of the period are unknown",
            remedy="write the forcing with sin or cos of an angle, or as an input with a period",
        )
    apart = np.ptp(found, axis=0) > _ALIKE * np.abs(found).max(axis=0)
    if apart.any():
        raise UsageError(
            f"a change of {' and '.join(np.array(parameters)[apart])} changes the forcing periods by different "
            "factors, so that the motion no longer repeats; the motion has no derivatives with respect to these "
            "parameters",
            remedy="request other derivatives, or write all periods as expressions of one parameter",
        )
    return np.asarray(found[0])


def _refuse_grazing(solution: Solution, orbit: Orbit) -> None:
    """Raise `UsageError` if a guard touches zero inside a segment, without an event."""
    guards = {q: int(n.removeprefix("guard ")) for q, n in enumerate(orbit.names) if n.startswith("guard ")}
    spans = (
        solution._segments.spans() + (solution._segments.origins().sum(axis=1) - solution.t_start)[:, None]
    )
    for quantity, piece, t, value, is_minimum in zip(*orbit.turns, strict=True):
        number = int(orbit.segments[piece])
        z, (first, last) = solution._segments[number].z, spans[number]
        is_inside = _ASIDE * (last - first) < min(t - first, last - t)
        if quantity not in guards or not is_minimum or not is_inside:
            continue
        is_active = solution._system.active(z)[guards[quantity]]
        if is_active and value <= _TOUCHES * np.abs(orbit.values[:, :, quantity]).max():
            raise UsageError(
                f"at t = {solution.t_start + t:.9g} {solution._system.guard_title(guards[quantity], z)} touches zero "
                "without an event (a graze), so the motion has no derivatives",
                remedy="use other parameters, at which the guard stays away from zero or passes through zero",
            )
