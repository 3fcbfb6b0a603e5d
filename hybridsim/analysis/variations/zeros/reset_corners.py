"""This module finds the directions in which a reset has a corner or jumps, such as abs(v) at v = 0."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from hybridsim.engine.lowering.reset_keys import declared_reset
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.series.dual_numbers import Dual
from hybridsim.engine.system.system import System
from hybridsim.model.meanings import Meanings
from hybridsim.model.smoothing.nonsmooth import has_word

_BESIDE = 2.0**-24  # of a quantity's own size: a step to both sides of a point, in search of a corner there
_BENT = 2.0**-10  # of the changes on both sides: a larger difference between them is a corner
_ROUNDINGS = 64.0

Arguments = tuple[Dual, list[Dual], list[Any]]
"""The time, the states and the run-time values, with their derivatives in M directions."""


class ResetCorners:
    """Compares the values that resets set at small distances from a point, in both senses of each direction.

    reset : the compiled resets. own (M,) : the change along each direction that is as large as the quantity itself.
    """

    def __init__(self, system: System, reset: Callable[..., Any], own: np.ndarray) -> None:
        self._system, self._reset, self._own = system, reset, own
        self._meanings = Meanings(system.model)
        self._crooked = {name for name, expr in system.model.definitions if has_word(expr)}

    def beside(
        self, key: tuple[Any, ...], arguments: Arguments, z: np.ndarray, before: list[Any]
    ) -> np.ndarray:
        """Return a mask (M,) of the directions in which the reset with the given key has a corner.

        before : the values before the reset, with derivatives.
        """
        found = np.zeros(len(self._own), dtype=bool)
        if not self._may_have_corners(key):
            return found
        here = self._after(arguments, z, before, 0, 0.0)
        for j, own in enumerate(self._own.tolist()):
            up, down = (
                self._after(arguments, z, before, j, sign * _BESIDE * own) - here for sign in (1.0, -1.0)
            )
            least = _BENT * (np.abs(up) + np.abs(down)) + _ROUNDINGS * UNIT * np.abs(here)
            found[j] = (np.abs(up + down) > least).any()
        return found

    def _may_have_corners(self, key: tuple[Any, ...]) -> bool:
        reset = declared_reset(self._system.model, key)
        names = {name for expr in reset.values() for name in expr.names}
        return any(map(has_word, reset.values())) or bool(self._meanings.depended_on(names) & self._crooked)

    def _after(
        self, arguments: Arguments, z: np.ndarray, before: list[Any], j: int, step: float
    ) -> np.ndarray:
        """Return the values that the reset sets after a step in direction j."""

        def moved(number: Any) -> float:
            return float(number.value + step * number.slope[j]) if isinstance(number, Dual) else float(number)

        s, x, lifted = arguments
        out = [moved(one) for one in before]
        self._reset(moved(s), [moved(one) for one in x], [moved(one) for one in lifted], z, out)
        return np.array(out)
