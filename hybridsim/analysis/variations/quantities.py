"""This module computes derivatives of outputs and other quantities from derivatives of the states."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hybridsim.analysis.variations.directions import Directions
from hybridsim.analysis.variations.values.vector_slopes import VectorSlopes
from hybridsim.engine.record.segments import Segment
from hybridsim.engine.series.dual_numbers import Dual, differentiated_rows, values_and_slopes
from hybridsim.engine.system.system import System
from hybridsim.errors import UsageError
from hybridsim.solution import Solution


class QuantityDerivatives:
    """Computes derivatives of states and quantities in M directions.

    Parameters
    ----------
    directions : derivatives of the parameters, beside those at the start of the run.
    """

    def __init__(self, solution: Solution, directions: Directions) -> None:
        self.system: System = solution._system
        self._trajectory, self._G = solution._of_model, directions.parameters
        self._vector = VectorSlopes(self.system, solution._segments[0].origin, directions.tables)
        self._velocities = list(self._trajectory._velocities)

    def of(
        self,
        names: Sequence[str],
        segment: Segment,
        s: np.ndarray,
        Y: np.ndarray,
        shift: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return the derivatives (k, m, M) of m quantities at local times (k,) of a segment.

        Y : derivatives (k, n + d, M) of the states and discrete states at these times.
        shift : derivatives (M,) of these times; by default the times are fixed.
        """
        system, model = self.system, self._trajectory.model
        states = [*system.names, *(d.name for d in model.discrete)]
        found = np.empty((len(s), len(names), Y.shape[2]))
        others: dict[str, list[tuple[int, int]]] = {"quantities": [], "surfaces": []}
        for k, name in enumerate(names):
            if name in states:
                found[:, k] = Y[:, states.index(name)]
            elif name in self._velocities:
                others["surfaces"].append((k, self._trajectory._velocities[name]))
            else:
                others["quantities"].append((k, self._place(name, segment.z)))
        for function, columns in others.items():
            if columns:
                slopes = self._slopes(function, segment, s, Y, shift)
                found[:, [k for k, _ in columns]] = slopes[:, [place for _, place in columns]]
        return found

    def _place(self, name: str, z: np.ndarray) -> int:
        """Return the index of a quantity. A variable that modes set has one index for each mode."""
        without_stick = self._trajectory._velocities_without_stick
        if name in without_stick:
            raise UsageError(
                f"{name} has no derivatives, because the contact has no stick",
                remedy=f"declare an output with the value {without_stick[name].velocity.text}",
            )
        known = self.system.quantities
        modes = [f"{a.name}.{a.modes[m]}" for a, m in zip(self.system.automata, z, strict=True)]
        special = [f"{name} in {mode}" for mode in modes if f"{name} in {mode}" in known]
        return known.index(special[-1] if special else name)

    def _slopes(
        self, name: str, segment: Segment, s: np.ndarray, Y: np.ndarray, shift: np.ndarray | None
    ) -> np.ndarray:
        """Return the derivatives (k, q, M) of all quantities or surfaces at k local times."""
        system = self.system
        function = differentiated_rows(getattr(system.code.module, name))
        count = len(system.quantities) if name == "quantities" else len(system.surface_of)
        x = segment.dense(s)
        with np.errstate(divide="ignore", invalid="ignore"):  # of derivatives that do not exist
            try:
                return self._evaluated(function, count, segment, s, x, Y, shift)
            except ValueError:  # a condition has different values at these times
                here = [slice(k, k + 1) for k in range(len(s))]
                return np.concatenate(
                    [self._evaluated(function, count, segment, s[k], x[k], Y[k], shift) for k in here]
                )

    def _evaluated(
        self,
        function: Callable[..., Any],
        count: int,
        segment: Segment,
        s: np.ndarray,
        x: np.ndarray,
        Y: np.ndarray,
        shift: np.ndarray | None,
    ) -> np.ndarray:
        """Evaluate a differentiated function at all times at once, or at a single time."""
        n, width = self.system.n, Y.shape[2]
        is_single = len(s) == 1

        def number(values: np.ndarray, slopes: np.ndarray) -> Dual:
            return Dual(values[0], slopes[0]) if is_single else Dual(values, slopes.T)

        states = [number(x[:, i], Y[:, i]) for i in range(n)]
        d = self.system.discrete(segment.p)
        p = self._vector.lifted(segment.p, d, Y[0, n:], self._G)
        if not is_single:
            p = [Dual(one.value, one.slope[:, None]) if isinstance(one, Dual) else one for one in p]
        time: Any = s[0] if is_single else s
        if shift is not None:
            time = Dual(time, shift if is_single else shift[:, None])
        out: list[Any] = [0.0] * count
        function(time, states, p, segment.z, out)
        if is_single:
            return values_and_slopes(out, width)[1][None]
        rows = [
            np.broadcast_to(one.slope, (width, len(s)))
            if isinstance(one, Dual)
            else np.zeros((width, len(s)))
            for one in out
        ]
        return np.array(rows).reshape(count, width, len(s)).transpose(2, 0, 1)
