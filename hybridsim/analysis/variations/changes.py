"""This module computes the derivatives of guards, monitors and surfaces along each direction."""

from __future__ import annotations

from dataclasses import dataclass

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
        """Return the rate of the function for given rates of the states, or 0 if its terms cancel each other."""
        terms = np.append(self.row * rates, self.by_time)
        return float(terms.sum()) if abs(terms.sum()) > TANGENTIAL * np.abs(terms).sum() else 0.0


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
        fixed = constants @ np.abs(np.concatenate([system.discrete(at.p), self.vector.constants()]))
        size = states @ self._scale
        sizes = states @ np.maximum(np.abs(at.Y), at.large) + constants @ np.abs(others)
        sizes += np.outer(times, np.abs(at.shift)) + _ROUNDING / _ALIKE * np.outer(
            size + fixed, 1.0 / self.own
        )
        passing = (states @ np.abs(flow) + times) * abs(at.origin + at.s)
        exact = states @ np.abs(at.x) + fixed + passing
        values = found.values[0, n:]
        is_zero, is_near = np.abs(values) <= EXACT * exact, np.abs(values) <= _ZERO * size
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
