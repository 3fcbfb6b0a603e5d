"""This module follows a branch of periodic orbits over a parameter, around folds and through unstable orbits."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any

import numpy as np

from hybridsim import arguments
from hybridsim.analysis.compare.comparison_request import whole
from hybridsim.analysis.continuation.branch import Branch, BranchPoint, specials
from hybridsim.analysis.continuation.starts import begun_elsewhere, fastest, in_shared, rates_at
from hybridsim.analysis.steady.measures import word_of
from hybridsim.analysis.steady.motion import Motion, point_at_end
from hybridsim.analysis.steady.settling import relative
from hybridsim.analysis.steady.shooting import Orbit, multipliers, rates_at_end
from hybridsim.analysis.steady.steady_state import steady_state
from hybridsim.analysis.variations.sensitivities import derivatives
from hybridsim.analysis.variations.sizes import sizes
from hybridsim.calls import refusing
from hybridsim.engine.system.period import common_period
from hybridsim.engine.system.system_cache import system_of
from hybridsim.errors import HybridsimError, UsageError
from hybridsim.model import Model
from hybridsim.model.parts.remedies import remedy_for_parameter
from hybridsim.solution import Solution

_CORRECTIONS = 8
_TOL = 1e-9  # of the states' sizes and the range; the tolerance for closing an orbit
# steps along the branch, relative to the range and the states
_FIRST, _LARGEST, _SMALLEST = 0.01, 0.05, 1e-6
_MORE, _LESS = 1.5, 0.4
_QUICK_CORRECTIONS = 3  # corrections, at most, after which the next step may grow
_DIFFERENCE = 1e-6  # of the parameter, to differentiate the forcing's period


@dataclass(frozen=True)
class _Closing:
    """The data of Newton's method for one orbit: the change x(T) - x(0), with its derivatives."""

    point: BranchPoint
    change: np.ndarray
    jacobian: np.ndarray  # (n + d [+ 1], n + d [+ 1] + 1): by start, period if it is free, parameter


@refusing
def continuation(
    model: Model | str | PathLike[str],
    parameter: str,
    bounds: tuple[float, float],
    *,
    params: Mapping[str, Any] | None = None,
    x0: Mapping[str, float] | None = None,
    max_points: int = 400,
    integrator: str = "auto",
    rtol: float = 1e-11,
    progress: Callable[[float], None] | bool | None = None,
    **options: Any,
) -> Branch:
    """Follow a periodic orbit over a parameter, in both directions, to the bounds or the branch's end.

    This is pseudo-arclength continuation (H. B. Keller, in Applications of Bifurcation Theory, ed. P. H.
    Rabinowitz, Academic Press 1977, 359) of the shooting equations. The derivatives come from the variational
    flow through the events. Stable and unstable orbits are both followed, and the branch passes folds. If the
    sequence of events changes, the map has a corner; the branch continues beyond it if Newton's method
    converges.

    Parameters
    ----------
    model : str, path or Model
        As in `steady_state`, which finds the first orbit at the model's own value.
    parameter, bounds : str, tuple of float
        The name of the parameter; its least and greatest value, which enclose the model's own value.
    params, x0 : mapping of str to float, optional
        As in `steady_state`.
    max_points : int, optional
        The largest number of orbits in each direction.
    integrator, rtol : str, float, optional
        As in `simulate`, for the runs along the branch.
    progress : bool or callable, optional
        True shows a bar; a function is called with the finished fraction from time to time.
    **options : Any
        Further options of `steady_state`, for the first orbit.

    Returns
    -------
    Branch
        The branch, with folds, branch points, period doublings, tori and changes of the mode sequence.

    Raises
    ------
    UsageError
        For invalid names or bounds, or a model that does not settle on a periodic orbit.

    Examples
    --------
    >>> import hybridsim as hs
    >>> branch = hs.continuation("dfcs", "F0", (29.0, 31.0))
    >>> bool(branch.stable.all())
    True
    """
    model = arguments.chosen_model(model, params)
    parameter = arguments.text(parameter, "parameter")
    most = whole(max_points, "max_points")
    if parameter not in [p.name for p in model.parameters]:
        raise UsageError(
            f"model {model.name} has no parameter {parameter!r}",
            remedy=remedy_for_parameter(model, parameter),
        )
    low, high = arguments.two_numbers(bounds, "bounds", "use two numbers, (low, high)")
    report = arguments.callback(progress)
    value = model.parameter_values()[parameter]
    if not low <= value <= high or low == high:
        raise UsageError(
            f"`bounds` {bounds!r} do not contain the model's value {parameter} = {value:g}",
            remedy="use bounds that contain the model's value, or change this value with "
            f"params={{{parameter!r}: ...}}",
        )
    method = {"integrator": integrator, "rtol": rtol, **options}
    start = steady_state(model, x0=x0, **method)
    if start.kind != "periodic" or start._closed is None:
        raise UsageError(
            f"model {model.name} does not settle on a periodic orbit at {parameter} = {value:g}: {start.message}",
            remedy="use other `params` or another `x0`",
        )
    follower = _Follower(model, parameter, (low, high), method, start._closed, start._is_free, most)
    first = follower.close(start._closed, value)
    if first is None:
        raise UsageError(
            f"the orbit at {parameter} = {value:g} cannot be followed: {follower.fault or start.message}",
            remedy="vary the parameter with hs.bifurcation",
        )
    sides = []
    for number, sign in enumerate((-1.0, 1.0)):
        sides.append(follower.follow(first, sign))
        if report is not None:
            report(0.5 * (number + 1))
    (backward, why_low), (forward, why_high) = sides
    points = (*reversed(backward), first.point, *forward)
    return Branch(parameter, points, specials(points), f"it ends at {why_low} and at {why_high}")


class _Follower:
    """Follows one branch of periodic orbits step by step."""

    def __init__(
        self,
        model: Model,
        parameter: str,
        bounds: tuple[float, float],
        method: dict[str, Any],
        orbit: Orbit,
        is_free: bool,
        max_points: int,
    ) -> None:
        self.model, self.parameter, self.bounds, self.method = model, parameter, bounds, method
        self.is_free, self.multiple, self.max_points = is_free, orbit.multiple, max_points
        solution = Motion(model, method).run(orbit.start, orbit.period)
        largest = np.concatenate([sizes(solution), np.abs(orbit.start.discrete)])
        scale = np.where(largest > 0.0, largest, 1.0)
        # start of the orbit, its period if that is free, the parameter
        self.unit = np.concatenate([scale, [orbit.period] if is_free else [], [bounds[1] - bounds[0]]])
        self.fault = ""  # the reason of the last failure
        self.section = self.first_section = fastest(solution, scale)

    def follow(self, first: _Closing, sign: float) -> tuple[list[BranchPoint], str]:
        """Return the branch points towards lower (sign -1) or higher parameters, and the reason why the branch ends."""
        found: list[BranchPoint] = []
        here, step, is_moved = first, _FIRST, False
        self.section = self.first_section
        direction = np.zeros(len(self.unit))
        direction[-1] = sign
        tangent = self._tangent(here, direction)
        while len(found) < self.max_points:
            unknowns = self._unknowns(here.point) + step * tangent
            there, count = self._correct(here.point, unknowns, tangent)
            if there is None:
                moved = None if is_moved or not self.is_free else self._elsewhere(here)
                is_moved = True
                if moved is not None:
                    here, tangent = moved, self._tangent(moved, in_shared(tangent, moved.point))
                    continue
                step *= _LESS
                if step < _SMALLEST:
                    at = here.point.parameter
                    return (
                        found,
                        f"{self.parameter} = {at:.9g} (no further orbit: the branch ends there or touches a guard)",
                    )
                continue
            value = there.point.parameter
            if not self.bounds[0] <= value <= self.bounds[1]:
                return found + self._at_bound(
                    here.point, there.point
                ), f"{self.parameter} = {self.bounds[0 if value < self.bounds[0] else 1]:g} (the bound)"
            found.append(there.point)
            tangent = self._tangent(there, tangent)
            here, is_moved = there, False
            if count <= _QUICK_CORRECTIONS:
                step = min(step * _MORE, _LARGEST)
        return found, f"{self.parameter} = {here.point.parameter:g} (after {self.max_points} points)"

    def _elsewhere(self, here: _Closing) -> _Closing | None:
        """Return the same orbit with another start, because neighbouring orbits may not pass the present start."""
        point, solution = begun_elsewhere(here.point)
        self.section = fastest(solution, self.unit)
        return self._closing(point, self._unknowns(point))

    def _at_bound(self, inside: BranchPoint, outside: BranchPoint) -> list[BranchPoint]:
        """Return the orbit at the parameter bound that lies between two points, or nothing if Newton's method fails."""
        bound = self.bounds[0] if outside.parameter < self.bounds[0] else self.bounds[1]
        share = (bound - inside.parameter) / (outside.parameter - inside.parameter)
        a, b = self._unknowns(inside), self._unknowns(outside)
        across = np.zeros(len(a))
        across[-1] = 1.0
        found, _ = self._correct(inside, a + share * (b - a), across)
        return [] if found is None else [found.point]

    def _unknowns(self, point: BranchPoint) -> np.ndarray:
        """Return start, period and parameter as one vector, each divided by its own unit."""
        orbit = point.orbit
        return (
            np.concatenate([orbit.start.values, [orbit.period] if self.is_free else [], [point.parameter]])
            / self.unit
        )

    def _tangent(self, here: _Closing, towards: np.ndarray) -> np.ndarray:
        """Return the unit vector along the branch in the direction of `towards`."""
        matrix = np.concatenate([here.jacobian, towards[None, :]])
        right = np.zeros(len(matrix))
        right[-1] = 1.0
        found = np.linalg.lstsq(matrix, right, rcond=None)[0]
        return found / np.linalg.norm(found)

    def _correct(
        self, previous: BranchPoint, unknowns: np.ndarray, tangent: np.ndarray
    ) -> tuple[_Closing | None, int]:
        """Apply Newton's method to a predicted point, in the plane across the tangent."""
        start, last = unknowns.copy(), math.inf
        for count in range(_CORRECTIONS):
            closing = self._closing(previous, unknowns)
            if closing is None:
                return None, count
            size = float(np.abs(closing.change).max())
            if size <= _TOL:
                return closing, count
            if not size < last:
                return None, count
            last = size
            matrix = np.concatenate([closing.jacobian, tangent[None, :]])
            right = np.append(-closing.change, -tangent @ (unknowns - start))
            unknowns = unknowns + np.linalg.lstsq(matrix, right, rcond=None)[0]
        return None, _CORRECTIONS

    def close(self, orbit: Orbit, value: float) -> _Closing | None:
        """Return the data of Newton's method for an orbit that is already periodic, or None if its run fails."""
        motion = Motion(self.model.with_(**{self.parameter: value}), self.method)
        point = BranchPoint(value, orbit, motion, np.zeros(0), (), self.is_free)
        return self._closing(point, self._unknowns(point))

    def _closing(self, previous: BranchPoint, unknowns: np.ndarray) -> _Closing | None:
        values = unknowns * self.unit
        value, count = float(values[-1]), len(previous.orbit.start.values)
        try:
            model = self.model.with_(**{self.parameter: value})
            motion = Motion(model, self.method)
            period, growth = (float(values[count]), 0.0) if self.is_free else self._forced(value)
            if not period > 0.0:
                return None
            n = len(previous.orbit.start.x)
            before = previous.orbit.start
            share = before.at / previous.orbit.period  # position of the section within the period
            start = replace(before, x=values[:n], discrete=values[n:count], at=share * period)
            start = motion.on_constraints(start)
            solution = motion.run(start, period)
            end = point_at_end(solution)
            if end.z != start.z:
                return None
            found = derivatives(solution, (self.parameter,), starts_follow=False)
        except HybridsimError as fault:
            self.fault = fault.message
            return None
        rates, at_start = (rates_at(solution, k, count) for k in (-1, 0))
        columns = [found.by_start - np.eye(count)]
        columns += [rates[:, None]] if self.is_free else []
        moved = rates * (1.0 + share) - found.by_start @ at_start * share  # effect of both ends of the period
        columns += [(found.by_parameter[:, 0] + moved * growth)[:, None]]
        unit = self.unit
        jacobian = np.concatenate(columns, axis=1) * unit[None, :] / unit[:count, None]
        change = (end.values - start.values) / unit[:count]
        if self.is_free:  # the phase condition: one state keeps its value
            row = np.zeros(len(unit))
            row[self.section] = 1.0
            jacobian = np.concatenate([jacobian, row[None, :]])
            previous_value = previous.orbit.start.values[self.section]
            change = np.append(change, (start.values[self.section] - previous_value) / unit[self.section])
        orbit = Orbit(start, period, self.multiple, relative(end.values - start.values, unit[:count]))
        found_here = multipliers(found.by_start, rates_at_end(solution) if self.is_free else None)
        point = BranchPoint(value, orbit, motion, found_here, _word(solution), self.is_free)
        return _Closing(point, change, jacobian)

    def _forced(self, value: float) -> tuple[float, float]:
        """Return the forcing period and its derivative with respect to the parameter."""

        def period(at: float) -> float:
            found = common_period(system_of(self.model.with_(**{self.parameter: at})))
            if found is None:
                raise UsageError(f"the forcing has no period at {self.parameter} = {at:g}")
            return self.multiple * found

        step = _DIFFERENCE * (abs(value) or 1.0)
        here, ahead, behind = period(value), period(value + step), period(value - step)
        return here, 0.0 if ahead == behind == here else (ahead - behind) / (2.0 * step)


def _word(solution: Solution) -> tuple[str, ...]:
    """Return the mode sequence of the orbit, cyclically shifted to be first in alphabetical order."""
    word = word_of(solution)
    return min((word[i:] + word[:i] for i in range(len(word))), default=word)
