"""This module fits a piecewise linear function to noisy points by least squares, with free knots."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import make_lsq_spline
from scipy.optimize import least_squares

from hybridsim.arguments import numbers, whole_number
from hybridsim.errors import UsageError

_REMEDY = "use one finite number for each measured point"
_CANDIDATES = 40  # positions at which a further knot is tried; more for more than 20 knots
_ROUNDS = 10  # most rounds in which each knot is moved to its best place among the others
_ROUGH, _FINE = 1e-4, 1e-14  # relative tolerances of an optimisation during the search and at its end
_GAIN = 1e-3  # a smaller relative gain of a round ends the search


def piecewise_linear(x: object, y: object, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return knots (count,) and values (count,) of the continuous piecewise linear function that fits best.

    The first and last knot are the ends of the data. The others are inserted one by one where they help most. After
    each insertion all of them are optimised together. At last each knot is taken out and inserted again, as long as
    this lowers the sum of squares.
    """
    points = _Points(x, y, count)
    inner = np.zeros(0)
    for _ in range(count - 2):
        inner = points.with_one_more(inner)
    for _ in range(_ROUNDS if count > 2 else 0):
        before = points.error(inner)
        for k in range(len(inner)):
            inner = min(inner, points.with_one_more(np.delete(inner, k)), key=points.error)
        if points.error(inner) >= (1.0 - _GAIN) * before:
            break
    if count > 2:
        inner = points.optimised(inner, _FINE)
    values = points.values(inner)
    assert values is not None  # the search keeps to knots with values
    return np.concatenate([points.ends[:1], inner, points.ends[1:]]), values


class _Points:
    """The points to fit, and the best values at given inner knots."""

    def __init__(self, x: object, y: object, count: int) -> None:
        first, second = (numbers(column, name, _REMEDY) for column, name in ((x, "at"), (y, "values")))
        if len(first) != len(second):
            message = f"`at` has {len(first)} numbers, but `values` has {len(second)}"
            raise UsageError(message, remedy=_REMEDY)
        if not (np.isfinite(first).all() and np.isfinite(second).all()):
            raise UsageError("`at` or `values` contains a number that is not finite", remedy=_REMEDY)
        order = np.argsort(first, kind="stable")
        self.x, self.y = first[order], second[order]
        distinct = np.unique(self.x)
        if len(distinct) < 2:
            raise UsageError("`at` contains fewer than two different numbers", remedy=_REMEDY)
        whole_number(count, "knots", 2, len(distinct))
        self.ends = distinct[[0, -1]]
        between = np.concatenate([distinct[1:-1], 0.5 * (distinct[1:] + distinct[:-1])])
        levels = np.linspace(0.0, 1.0, max(_CANDIDATES, 2 * count))
        self.candidates = np.unique(np.quantile(between, levels, method="nearest"))

    def values(self, inner: np.ndarray) -> np.ndarray | None:
        """Return the best values at all knots, or None if the points do not determine them."""
        (a, b), knots = self.ends, np.sort(inner)
        try:
            found: np.ndarray = make_lsq_spline(self.x, self.y, np.array([a, a, *knots, b, b]), k=1).c
        except (ValueError, np.linalg.LinAlgError):
            return None
        return found if np.isfinite(found).all() else None

    def residuals(self, inner: np.ndarray) -> np.ndarray:
        """Return the residual at each point; all residuals are large if the points do not determine the fit."""
        values = self.values(inner)
        if values is None:
            return np.full(len(self.x), 1e3 * (np.ptp(self.y) or 1.0))
        knots = np.concatenate([self.ends[:1], np.sort(inner), self.ends[1:]])
        return np.interp(self.x, knots, values) - self.y

    def error(self, inner: np.ndarray) -> float:
        """Return the sum of squares."""
        residuals = self.residuals(inner)
        return float(residuals @ residuals)

    def with_one_more(self, inner: np.ndarray) -> np.ndarray:
        """Return the inner knots with one more knot at its best place; all knots are optimised together."""
        tried = [np.sort(np.append(inner, one)) for one in self.candidates if one not in inner]
        best = min(tried, key=self.error)
        return self.optimised(best, _ROUGH)

    def optimised(self, inner: np.ndarray, tolerance: float) -> np.ndarray:
        """Return the inner knots after optimisation; each knot stays between the midpoints to its neighbours."""
        middles = np.concatenate([self.ends[:1], 0.5 * (inner[1:] + inner[:-1]), self.ends[1:]])
        bounds, scale = (middles[:-1], middles[1:]), np.diff(middles)
        found = least_squares(
            self.residuals, inner, bounds=bounds, x_scale=scale, xtol=tolerance, ftol=tolerance
        )
        return min(inner, found.x, key=self.error)
