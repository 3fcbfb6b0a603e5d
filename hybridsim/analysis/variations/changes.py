"""What a change along each direction makes of guards, monitors and surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hybridsim.analysis.variations.seeds import seeds
from hybridsim.engine.tangents import TangentTape

if TYPE_CHECKING:
    from hybridsim.engine.system import System

_ALIKE = 1e-7  # of its terms: a change that is less is none
_ROUNDING = 1e-11  # of what a change of everything by its own size does: below it is rounding
_EXACT = 2.0**-46  # of its terms: a value that is less is zero
_AT_ZERO = 1e-9  # of what a guard's terms are along the run: it is at its zero, and so has fired by itself
_TANGENTIAL = (
    1e-9  # a guard that falls by less than this part of its terms leaves the time of its event undefined
)


@dataclass(frozen=True)
class Place:
    """Where derivatives are at: local time, its origin, states, run-time vector and modes, and derivatives there.

    Y, Yd : of the states (n, M) and discrete states (d, M); shift : of the time (M,).
    large : sizes (n, M) of the terms whose sums Y are.
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
    """One guard, monitor or surface: its value, and its derivatives (M,) with the sizes of their terms (M,).

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
        """Mask (M,) of the directions along which it changes."""
        return np.asarray(np.abs(self.by) > _ALIKE * self.sizes)

    def along(self, rates: np.ndarray) -> float:
        """Its rate where the states have these rates (n,); 0 where that is nothing beside its terms."""
        terms = np.append(self.row * rates, self.by_time)
        return float(terms.sum()) if abs(terms.sum()) > _TANGENTIAL * np.abs(terms).sum() else 0.0


class Changes:
    """Derivatives of guards, monitors and surfaces in M directions.

    Parameters
    ----------
    scale : (n,) sizes of the states.
    own : (M,) the change along each direction that is as large as what it changes.
    G : derivatives of the parameters (P, M).
    rates : derivatives of the forcing's angular rates by the parameters.
    """

    def __init__(
        self, system: System, scale: np.ndarray, own: np.ndarray, G: np.ndarray, rates: np.ndarray
    ) -> None:
        self.system, self.G, self.rates = system, G, rates
        self._scale, self.own = scale, own

    def flow(self, at: Place) -> tuple[np.ndarray, np.ndarray]:
        """The rates (n,) of the states, and their derivatives by all that formulas read."""
        found = TangentTape(self.system, at.z)(
            np.array([at.s]), at.x[None, :], at.p, seeds(self.system, at.origin, self.rates)
        )
        return found.values[0], found.slopes[0]

    def of(
        self,
        at: Place,
        guards: tuple[int, ...] = (),
        monitors: tuple[int, ...] = (),
        surfaces: tuple[int, ...] = (),
    ) -> list[Changed]:
        """Of the guards, then the monitors, then the surfaces with these numbers."""
        system, n = self.system, self.system.n
        tape = TangentTape(system, at.z, guards, monitors, surfaces)
        found = tape(np.array([at.s]), at.x[None, :], at.p, seeds(system, at.origin, self.rates))
        flow, changes = found.values[0, :n], np.concatenate([at.Y, at.Yd, self.G])
        sized = np.concatenate([np.maximum(np.abs(at.Y), at.large), np.abs(at.Yd), np.abs(self.G)])
        constants = np.abs(np.concatenate([system.discrete(at.p), at.p[: len(self.G)]]))
        result = []
        for value, row in zip(found.values[0, n:], found.slopes[0, n:], strict=True):
            by = np.concatenate([row[:n], row[n + 1 :]])
            terms = np.append(row[:n] * flow, row[n])
            fixed = np.abs(row[n + 1 :]) @ constants
            size = np.abs(row[:n]) @ self._scale
            passing = row[n] * at.shift
            sizes = np.abs(by) @ sized + np.abs(passing)
            exact = np.abs(row[:n]) @ np.abs(at.x) + fixed + np.abs(terms).sum() * abs(at.origin + at.s)
            result.append(
                Changed(
                    float(value),
                    by @ changes + passing,
                    sizes + _ROUNDING / _ALIKE * (size + fixed) / self.own,
                    row[:n],
                    float(row[n]),
                    bool(abs(value) <= _EXACT * exact),
                    bool(abs(value) <= _AT_ZERO * size),
                )
            )
        return result
