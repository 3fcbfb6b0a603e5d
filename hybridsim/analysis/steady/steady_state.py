"""This module finds and measures the steady motion of a model."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np

from hybridsim import arguments
from hybridsim.analysis.keyword_options import refuse_unknown
from hybridsim.analysis.steady.approach import is_approached
from hybridsim.analysis.steady.irregular.incommensurate import follow
from hybridsim.analysis.steady.irregular.lyapunov import long_growth
from hybridsim.analysis.steady.motion import (
    CostsMore,
    CostsTooMuch,
    GrowsWithoutBound,
    Motion,
    Point,
)
from hybridsim.analysis.steady.period_argument import (
    refuse_plain_time,
    refuse_what_ends,
    require_multiple,
)
from hybridsim.analysis.steady.result import SteadyState
from hybridsim.analysis.steady.settling import (
    CLOSER,
    Passings,
    died_out,
    forced_passings,
    free_passings,
    is_rest,
)
from hybridsim.analysis.steady.shooting import Orbit, followed_closely, shoot
from hybridsim.analysis.steady.shortest_period import with_shortest_period
from hybridsim.analysis.steady.together import (
    EQUILIBRIUM,
    PERIODIC,
    Effort,
    can_be_compiled,
    message_of,
    settled,
)
from hybridsim.analysis.variations.sensitivities import derivatives
from hybridsim.analysis.variations.sizes import ranges
from hybridsim.arguments import cannot_be
from hybridsim.calls import refusing
from hybridsim.engine.system.period import all_periods, common_period
from hybridsim.engine.system.system_cache import system_of
from hybridsim.errors import UsageError
from hybridsim.mechanics.declaration.system import MechanicalSystem
from hybridsim.model import Model
from hybridsim.simulate import simulate

_MAX_PERIODS_PER_RUN = 512
_MAX_PERIODS_EVER = 10**6  # more would take days
_TIME_BUDGET = 60.0  # approximate seconds for these periods
_DURATION = 100.0  # of a first run without forcing, if the model has no duration
_FIRST_RUN = {
    "events": 1000,
    "steps": 20000,
}  # the limits of that run; if they are reached, the model's own time scale is shorter
_FEWEST = 4  # passages that are needed for a decision
_WAIT = 256  # periods that take as long as a few Newton steps
_FIRST_EXTRAPOLATION = 128  # periods after which the limit of contacts that slip ever less is extrapolated
_MARGIN = 1.1  # on the expected number of periods
_GROWS = 1.2  # a larger growth means a state that grows without end
_TIGHTER = 1e-2  # the runs' tolerance relative to that of the steady state
_NOTHING_LEFT = 1e-13  # of the scale that a state once had
QUASI, CHAOTIC, UNSETTLED = "quasi-periodic", "chaotic", "not settled"


@refusing
def steady_state(
    model: Model | MechanicalSystem | str | PathLike[str],
    *,
    params: Mapping[str, Any] | None = None,
    x0: Mapping[str, float] | Sequence[float] | None = None,
    z0: Mapping[str, str] | None = None,
    period: float | None = None,
    integrator: str = "auto",
    rtol: float | None = None,
    tol: float = Effort().tol,
    settle: int = Effort().settle,
    max_periods: int = Effort().max_periods,
    progress: Callable[[float], None] | bool | None = None,
    **options: Any,
) -> SteadyState:
    """Find the steady motion that a model reaches from its initial state, and measure one period of it.

    A run is followed until it repeats; then Newton's method on the period map (single shooting) replaces
    waiting, with a matrix from the variational flow through the events (`hs.sensitivities`). If the sequence
    of events changes between Newton steps, or Newton's method does not converge, the run continues instead.
    Only stable motions are returned, because a model does not settle on an unstable one. If the periods of
    forcing and clocks have no common multiple, the motion is quasi-periodic if every small change of its
    start decays, and not settled otherwise.

    Parameters
    ----------
    model : str, path, Model or MechanicalSystem
        As in `simulate`. A `MechanicalSystem` needs a harmonic force or base, and a start in ``x0`` only. Its
        states are followed from period to period, and extrapolated to their limit while the events stay the
        same.
    params, x0, z0 : mapping, optional
        As in `simulate`. For a `MechanicalSystem` ``params`` sets ``omega`` and ``CONTACT.normal``, for example;
        `sweep` lists the names.
    period : float, optional
        Period of the forcing; by default that of the model. Without forcing the period is unknown and is
        found with the motion.
    integrator, rtol : str, float, optional
        As in `simulate`; by default rtol is tol/100.
    tol : float, optional
        Tolerance for the repetition of the states, relative to the largest size of each along the motion. The
        motion has a similar accuracy.
    settle : int, optional
        Periods (without forcing, passages of a section) before the first test.
    max_periods : int, optional
        Number of periods after which the motion is classified as it is: chaotic if its largest Lyapunov
        exponent is positive, quasi-periodic if the exponent is zero, else not settled.
    progress : bool or callable, optional
        True shows a bar. A function is called from time to time with the finished fraction of these periods; an
        exception from it ends the search.
    **options : Any
        As in `simulate`.

    Returns
    -------
    SteadyState
        The result. Its ``kind`` classifies the motion; period, amplitude, energy, stick fraction, multipliers and so on
        exist for a motion that repeats or rests, and raise an error otherwise.

    Raises
    ------
    UsageError
        For invalid arguments, or a forcing that never repeats (a table, a chirp).
    SimulationError
        If a run ends early.

    Examples
    --------
    >>> import hybridsim as hs
    >>> steady = hs.steady_state("dfcs")
    >>> steady.kind, sorted(steady.word), steady.stops_per_period["f"]
    ('periodic', ['slip+', 'slip-', 'stick', 'stick'], 2.0)
    """
    if not isinstance(model, MechanicalSystem):
        model = arguments.chosen_model(model, params)
    tol = arguments.number(tol, "tol")
    if not 0.0 < tol < 1.0:
        raise cannot_be("tol", tol, "use a relative tolerance between 0 and 1, such as 1e-10")
    for name, count in (("settle", settle), ("max_periods", max_periods)):
        arguments.whole_number(count, name, 1, _MAX_PERIODS_EVER)
    report = arguments.callback(progress)
    used = max(_TIGHTER * tol, 10.0 * arguments.SMALLEST_RTOL) if rtol is None else rtol
    effort = Effort(tol, settle, max_periods)
    if isinstance(model, MechanicalSystem):
        from hybridsim.analysis.structures.steady_state import steady_state_of_structure

        chosen = {"params": params, "x0": x0, "z0": z0, "period": period, "integrator": integrator, **options}
        return steady_state_of_structure(model, effort, used, report, **chosen)
    system = system_of(model)
    refuse_what_ends(system)
    refuse_plain_time(system, None if period is None else require_multiple(period, None, model.name))
    chosen = {"x0": x0, "z0": z0, "period": period, "integrator": integrator, **options}
    own = common_period(system)
    if period is None:
        period = own
    else:
        require_multiple(period, own, f"model {model.name}")
    method = {"integrator": integrator, "rtol": used}
    refuse_unknown([steady_state, simulate], {**method, **options})
    motion = Motion(model, {**method, **options}, {"x0": x0, "z0": z0})
    if own is not None and can_be_compiled(system, chosen):
        together = settled(motion, effort)
        if together is not None:
            return together
    motion.time_budget = _TIME_BUDGET * max(1.0, max_periods / Effort().max_periods)
    search = _Search(motion, period, tol, settle, max_periods)
    try:
        if period is None and (periods := all_periods(system)):
            motion.progress = report
            found = follow(motion, max(periods), max(settle, _FEWEST), max_periods)
            kind = EQUILIBRIUM if found.rests else QUASI if found.dies_out else UNSETTLED
            return _found(motion, kind, found.rests, periods=found.periods, message=found.message)
        if report is not None:
            motion.progress = lambda _: report(search.share)
        return search.run()
    except (CostsTooMuch, GrowsWithoutBound) as fault:
        return _found(
            motion, UNSETTLED, None, periods=search.periods, message=f"{UNSETTLED}: {fault.message}"
        )


class _Search:
    """Follows a motion until it is known to be periodic, at rest or irregular."""

    def __init__(
        self,
        motion: Motion,
        period: float | None,
        tol: float,
        settle: int,
        max_periods: int,
    ) -> None:
        self.motion, self.period, self.tol = motion, period, tol
        self.settle, self.max_periods = max(settle, _FEWEST), max_periods
        self.newton_steps, self.periods = 0, 0
        declared = motion.model.duration_value()
        self.duration = declared or _DURATION
        self.least = (
            0.0 if declared else _DURATION
        )  # of an interval that can distinguish rest from slow motion
        self.scale = self.earlier = np.zeros(0)  # of the states, over the last intervals that were followed
        self.seen = np.zeros(0)  # largest scale of each state so far
        self.largest = np.zeros(len(motion.names))  # scale of each state when it moved most
        self.without = 0  # consecutive intervals on which nothing returned
        self.expected = 0  # expected number of periods until the motion has settled
        can_extrapolate = system_of(motion.model).surface_of and not motion.discrete
        self._next_extrapolation = _FIRST_EXTRAPOLATION if can_extrapolate else math.inf

    def run(self) -> SteadyState:
        passings = self._follow(None)
        while True:
            self.earlier, self.scale = self.scale, passings.scale
            passings = self._not_below_rounding(passings)
            if passings.rests:
                return _found(self.motion, EQUILIBRIUM, self._orbit(passings, 1), periods=self.periods)
            orbit = self._closed(passings)
            if orbit is not None:
                return self._periodic(orbit)
            self.without = self.without + 1 if len(passings.times) < _FEWEST else 0
            if self.without > 1 and (passings.adds_up or self.without > _ROUNDS):
                return self._without_return(passings)
            if self.periods >= self.max_periods:
                return self._other(passings)
            passings = self._follow(passings)

    def _not_below_rounding(self, passings: Passings) -> Passings:
        """Return the passages after raising those scales that are smaller than rounding errors.

        A state that has decayed relative to its former size has no scale of its own. A discrete state that
        settles on zero gets its size from the other states: from the effect over one period of a change of
        them by their own size.
        """
        self.seen = passings.scale if not len(self.seen) else np.maximum(self.seen, passings.scale)
        scale = np.maximum(passings.scale, _NOTHING_LEFT * self.seen)
        n = len(self.motion.names)
        if len(scale) > n and self.period is not None and not passings.rests:
            matrix = np.abs(self._over_a_period(passings.last))
            sizes = np.concatenate([self.motion.sizes, np.abs(passings.last.discrete)])
            scale[n:] = np.maximum(scale[n:], matrix[n:] @ sizes)
        self.scale = scale
        return replace(passings, scale=scale)

    def _over_a_period(self, start: Point) -> np.ndarray:
        """Return the Jacobian of the period map, (n + d, n + d), or zeros if the Jacobian is unknown."""
        try:
            return derivatives(self.motion.run(start, self.period or 0.0), ()).by_start
        except UsageError:
            return np.zeros((len(start.values), len(start.values)))

    @property
    def share(self) -> float:
        """The number of periods so far as a fraction of the largest allowed number."""
        return min(self.periods / self.max_periods, 1.0)

    def _follow(self, last: Passings | None) -> Passings:
        """Continue the motion from its present point, for as long as it has run so far."""
        start = None if last is None else last.last
        if self.period is not None:
            count = self.expected or min(max(self.settle, self.periods), _MAX_PERIODS_PER_RUN)
            self.expected = 0
            self.periods += count
            phase = 0.0 if last is None else last.last.at
            return forced_passings(self.motion, start, self.period, count, phase, self.largest)
        for _ in range(_LONGER):
            passings = self._passed(start)
            if passings.rests:
                # an interval that was cut short shows nothing about slow motion
                if self.duration >= self.least or self.motion.stands_still(passings.last):
                    break
            elif len(passings.times) >= _FEWEST or (passings.adds_up and last is not None):
                break
            self.duration *= 4.0
        self.periods += len(passings.times)
        if passings.rests or len(passings.times) >= self.settle:
            return passings
        self.duration *= 2.0
        return passings

    def _passed(self, start: Point | None) -> Passings:
        """Return the motion over a duration. The first call may shorten the duration to limit the cost."""
        is_free_to_choose = start is None and self.least > 0.0 and "limits" not in self.motion.options
        if is_free_to_choose and self.duration == self.least:
            try:
                return free_passings(self.motion, start, self.duration, self.largest, limits=_FIRST_RUN)
            except CostsMore as early:
                self.duration = early.reached
        return free_passings(self.motion, start, self.duration, self.largest)

    def _closed(self, passings: Passings) -> Orbit | None:
        """Return the periodic orbit of the motion, directly or by Newton's method, or None."""
        orbit = self._repeated(passings)
        return None if orbit is None or self._has_died_out(orbit) else orbit

    def _has_died_out(self, orbit: Orbit) -> bool:
        """Return whether a closed orbit of an unforced model is an equilibrium disturbed by rounding only."""
        if self.period is not None:
            return False
        low, high = ranges(self.motion.run(orbit.start, orbit.period), 0.0)
        return died_out(low, high, self.largest)

    def _repeated(self, passings: Passings) -> Orbit | None:
        multiple = passings.repeats_after(self.tol)
        if multiple is not None:
            return self._orbit(passings, multiple)
        if len(passings.values) < 2:
            return None
        multiple = passings.nearest()
        if passings.more(multiple, self.tol) > self.max_periods:  # it does not come closer
            orbit = self._orbit(passings, multiple)
            found = followed_closely(self.motion, orbit, passings.scale, self.period is None)
            if found.residual <= CLOSER * self.tol:
                return found
        self.expected = (
            math.ceil(min(_MARGIN * passings.more(multiple, self.tol), _MAX_PERIODS_PER_RUN)) + 2 * multiple
        )
        if self.period is not None and self.expected <= _WAIT:
            return None  # it settles before Newton's method would be ready
        self.expected = 0
        shot = self._shot(passings, multiple)
        if shot is None and self.period is not None and self.periods >= self._next_extrapolation:
            from hybridsim.analysis.extrapolation.model_periods import extrapolated

            self._next_extrapolation = 2 * self.periods
            most = min(self.periods, _MAX_PERIODS_PER_RUN)
            return extrapolated(self.motion, passings, self.period, self.tol, most)
        return shot

    def _shot(self, passings: Passings, multiple: int) -> Orbit | None:
        start = self._orbit(passings, multiple)
        section = None if self.period is not None else passings.state
        found = shoot(self.motion, start, passings.scale, section, self.tol)
        self.newton_steps += found.steps
        if not (found.converged and found.attracts):
            return None
        return found if is_approached(self.motion, passings.last, found, passings.scale, section) else None

    def _orbit(self, passings: Passings, multiple: int) -> Orbit:
        if self.period is not None:
            period = multiple * self.period
        elif passings.rests:
            period = self.duration
        else:
            period = float(passings.times[-1] - passings.times[-1 - min(multiple, len(passings.times) - 1)])
        return Orbit(passings.last, period, multiple, passings.residual(multiple))

    def _periodic(self, orbit: Orbit) -> SteadyState:
        steps = orbit.steps
        orbit = with_shortest_period(self.motion, orbit, self.scale, self.period is not None, self.tol)
        self.newton_steps += orbit.steps - steps
        from hybridsim.analysis.extrapolation import slight_slips
        from hybridsim.analysis.extrapolation.model_periods import ModelPeriods

        repeated = ModelPeriods(self.motion, orbit.start, orbit.period)
        residual, slight = slight_slips.after_slight_slips(repeated, 1, orbit.residual, self.scale, self.tol)
        orbit = replace(orbit, start=repeated.point, residual=residual)
        rests = is_rest(self.motion, orbit.start, orbit.period, self.largest, self.periods)
        kind = EQUILIBRIUM if rests else PERIODIC
        message = message_of(kind, orbit, self.period is not None) + slight_slips.message_of(slight)
        return _found(self.motion, kind, orbit, self.period is None, self.newton_steps, self.periods, message)

    def _other(self, passings: Passings) -> SteadyState:
        """Use the largest Lyapunov exponent to classify a motion that does not repeat."""
        base = self.period if self.period is not None else float(passings.times[-1] - passings.times[-2])
        # exponents need derivatives, which Python functions do not have
        has_slopes = system_of(self.motion.model).has_tape
        growth = long_growth(self.motion, passings.last, base) if has_slopes else None
        exponent, leaving = math.nan, self._leaving(passings)
        kind, reason = UNSETTLED, "its kind is unknown, because derivatives of Python functions are unknown"
        if growth is not None:
            exponent = growth.exponent
            if not leaving and (growth.is_exponential or growth.is_bounded):
                kind = CHAOTIC if growth.is_exponential else QUASI
                reason = f"largest Lyapunov exponent {exponent:.3g} per unit of time"
            else:
                reason = f"over {growth.periods} more periods a small change {_grown(growth.logarithm)}"
        message = f"{kind} after {self.periods} periods: {reason}"
        if leaving:
            message += f", but {leaving} never returns: nothing restores it, or it only accumulates"
        found = _found(self.motion, kind, replace(self._orbit(passings, 1), residual=passings.residual(1)))
        found.lyapunov, found.message, found.periods = exponent, message, self.periods
        return found

    def _without_return(self, passings: Passings) -> SteadyState:
        """Return the result for a motion that never returns to earlier states."""
        name = self.motion.names[passings.state]
        orbit = Orbit(passings.last, self.duration, 1, math.inf)
        message = (
            f"{UNSETTLED} within {self.duration:.3g} units of time: {name} does not return; if it only grows, remove "
            "it from the model, and if it is slow, give the model a longer duration"
        )
        return _found(self.motion, UNSETTLED, orbit, periods=self.periods, message=message)

    def _leaving(self, passings: Passings) -> str:
        """Return the name of a state that does not come back to earlier values, or an empty string."""
        names = [*self.motion.names, *self.motion.discrete]
        drifting = passings.drifting()
        if drifting is not None:
            return names[drifting]
        grown = passings.scale > _GROWS * self.earlier if len(self.earlier) else np.zeros(0)
        return names[int(np.argmax(grown))] if grown.any() else ""


_LONGER, _ROUNDS = 8, 3  # factor by which an interval is lengthened, and number of intervals without a return


def _grown(logarithm: float) -> str:
    """Return the words for the growth of a small change, of which the natural logarithm is given."""
    if logarithm == -math.inf:
        return "vanishes"
    return f"is multiplied by 10^{logarithm / math.log(10.0):.1f}"


def _found(
    motion: Motion,
    kind: str,
    orbit: Orbit | None,
    is_free: bool = False,
    newton_steps: int = 0,
    periods: int = 0,
    message: str = "",
) -> SteadyState:
    return SteadyState(motion.unwatched(), kind, orbit, is_free, newton_steps, periods, message or kind)
