"""This module computes the derivatives of guards, monitors and surfaces along each direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hybridsim.analysis.variations.tapes import tangent_tape
from hybridsim.analysis.variations.values.no_derivative import no_derivative
from hybridsim.analysis.variations.values.vector_slopes import VectorSlopes
from hybridsim.engine.system.system import System

_ALIKE = 1e-7  # of its terms: a smaller change is zero
_ROUNDING = 1e-11  # of the effect of a change of everything by its own size: a smaller one is rounding
EXACT = 2.0**-46  # of its terms: a smaller value is zero
_ZERO = 1e-9  # of a guard's terms along the run: it is at zero, and so has fired by itself
TANGENTIAL = (
    1e-9  # a guard that falls by less than this part of its terms leaves the time of its event undefined
)


@dataclass(frozen=True)
class Place:
    """A point of a run at which derivatives are computed: time, states, parameters and modes.

    Y, Yd : derivatives of the states (n, M) and discrete states (d, M); shift : of the time (M,).
    large : sizes (n, M) of the terms of the sums Y.
    """

    s: float
    origin: float
    x: np.ndarray
    p: np.ndarray
    z: np.ndarray
    Y: np.ndarray
    Yd: np.ndarray
    shift: np.ndarray
    large: np.ndarray


@dataclass(frozen=True)
class Changed:
    """A guard, monitor or surface: its value, its derivatives (M,), and the sizes (M,) of their terms.

    row (n,), by_time : its derivatives by the states and by time.
    """

    value: float
    by: np.ndarray
    sizes: np.ndarray
    row: np.ndarray
    by_time: float
    is_zero: bool
    is_near: bool

    @property
    def moves(self) -> np.ndarray:
        """A mask (M,) of the directions in which this function changes."""
        return np.asarray(np.abs(self.by) > _ALIKE * self.sizes)

    def along(self, rates: np.ndarray) -> float:
        """Return the rate of the function for given rates of the states, or 0 if the terms of this rate cancel."""
        return float(speed_along(self.row, self.by_time, rates))


def speed_along(rows: np.ndarray, by_time: Any, rates: np.ndarray) -> np.ndarray:
    """Return rates of functions along a run (...,), which are 0 where their terms cancel each other.

    rows (..., n), by_time (...,) : derivatives by the states and by time; rates (..., n) : rates of the states.
    """
    terms = np.concatenate([rows * rates, np.asarray(by_time)[..., None]], axis=-1)
    speeds = terms.sum(axis=-1)
    return np.where(np.abs(speeds) > TANGENTIAL * np.abs(terms).sum(axis=-1), speeds, 0.0)


def are_zero(
    values: np.ndarray, slopes: np.ndarray, flow: np.ndarray, x: np.ndarray, constants: np.ndarray, t: Any
) -> np.ndarray:
    """Return which functions (..., k) are zero except for rounding of their terms.

    slopes (..., k, n + 1 + q) : derivatives by the states, by time and by the constants (..., q); flow, x (..., n) :
    rates and states; t (...,) : the time.
    """
    sizes, n = np.abs(slopes), x.shape[-1]
    passing = np.einsum("...ka,...a->...k", sizes[..., :n], np.abs(flow)) + sizes[..., n]
    terms = np.einsum("...ka,...a->...k", sizes[..., :n], np.abs(x))
    terms += np.einsum("...ka,...a->...k", sizes[..., n + 1 :], np.abs(constants))
    return np.asarray(np.abs(values) <= EXACT * (terms + passing * np.abs(np.asarray(t))[..., None]))


class Changes:
    """Computes derivatives of guards, monitors and surfaces in M directions.

    Parameters
    ----------
    scale : (n,) sizes of the states.
    own : (M,) the change along each direction that is as large as the quantity that it changes.
    G : derivatives of the parameters (P, M).
    vector : derivatives of the run-time vector.
    """

    def __init__(
        self, system: System, scale: np.ndarray, own: np.ndarray, G: np.ndarray, vector: VectorSlopes
    ) -> None:
        self.system, self.G, self.vector = system, G, vector
        self._scale, self.own = scale, own

    def flow(self, at: Place) -> tuple[np.ndarray, np.ndarray]:
        """Return the rates (n,) of the states, and their derivatives with respect to all arguments of the rates."""
        found = tangent_tape(self.system, at.z)(
            np.array([at.s]), at.x[None, :], at.p, self.vector.seeds(at.p)
        )
        return found.values[0], found.slopes[0]

    def of(
        self,
        at: Place,
        guards: tuple[int, ...] = (),
        monitors: tuple[int, ...] = (),
        surfaces: tuple[int, ...] = (),
    ) -> list[Changed]:
        """Return values and derivatives of the guards, monitors and surfaces with the given numbers."""
        system, n = self.system, self.system.n
        tape = tangent_tape(system, at.z, guards, monitors, surfaces)
        found = tape(np.array([at.s]), at.x[None, :], at.p, self.vector.seeds(at.p))
        self._refuse_without(at, found.slopes[0, n:], guards)
        flow, rows = found.values[0, :n], found.slopes[0, n:]
        by_states, by_time, by_others = rows[:, :n], rows[:, n], rows[:, n + 1 :]
        others = np.concatenate([at.Yd, self.G])
        by = by_states @ at.Y + by_others @ others + np.outer(by_time, at.shift)
        states, times, constants = np.abs(by_states), np.abs(by_time), np.abs(by_others)
        numbers = np.concatenate([system.discrete(at.p), self.vector.constants()])
        size = states @ self._scale
        sizes = states @ np.maximum(np.abs(at.Y), at.large) + constants @ np.abs(others)
        sizes += np.outer(times, np.abs(at.shift)) + _ROUNDING / _ALIKE * np.outer(
            size + constants @ np.abs(numbers), 1.0 / self.own
        )
        values = found.values[0, n:]
        is_zero = are_zero(values, rows, flow, at.x, numbers, at.origin + at.s)
        is_near = np.abs(values) <= _ZERO * size
        return [
            Changed(
                value, by[k], sizes[k], by_states[k], float(by_time[k]), bool(is_zero[k]), bool(is_near[k])
            )
            for k, value in enumerate(values.tolist())
        ]

    def _refuse_without(self, at: Place, rows: np.ndarray, guards: tuple[int, ...]) -> None:
        """Raise `UsageError` if a row of derivatives of a guard, monitor or surface has an entry that is not finite."""
        bad = ~np.isfinite(rows)
        for k in np.flatnonzero(bad.any(axis=1)):
            title = "the function of a monitor or surface"
            if k < len(guards):
                title = self.system.guard_title(guards[k], at.z)
            by = [name for name, is_bad in zip(self.vector.arguments, bad[k], strict=True) if is_bad]
            raise no_derivative(self.system, title, by, at.origin + at.s, at.x, ())
