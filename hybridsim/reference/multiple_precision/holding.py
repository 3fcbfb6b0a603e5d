"""This module solves for the forces that hold surfaces at zero, and for the held states.

With J the slopes of the surfaces along the states and G the effects of the unknowns on the rates, both at the start
of a series, the n-th coefficients of the unknowns change the (n + 1)-th ones of the surfaces by J G / (n + 1).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hybridsim.errors import UsageError
from hybridsim.reference.multiple_precision.nodes import in_order
from hybridsim.reference.multiple_precision.precision import Number
from hybridsim.reference.multiple_precision.reading import Reading


class Holding:
    """The held surfaces of one combination of modes, and their slopes at the start of a series."""

    def __init__(self, reading: Reading, context: Any) -> None:
        self.context = context
        self.names = tuple(reading.unknowns)
        self._states = list(reading.states.values())
        self._surfaces = [reading.surfaces[name] for name in self.names]
        self._nodes = [node for node in in_order(self._surfaces) if node.operands and not node.constant]
        self._effects: list[list[Number]] = []
        self._slopes: list[list[Number]] = []
        self._product: list[list[Number]] = []
        self.pins: list[int] = []

    def begin(self, effects: list[list[Number]]) -> None:
        """Store the effects of the unknowns, compute the slopes of the surfaces, and choose the states to solve for."""
        self._effects = effects
        self._find_slopes()
        self._product = [[self.context.fdot(row, effect) for effect in effects] for row in self._slopes]
        self.pins = self._choose_pins()

    def coefficients(self, n: int) -> list[Number]:
        """Compute the n-th coefficients of the surfaces from the n-th coefficients of the states."""
        for node in self._nodes:
            if len(node.c) <= n:
                node.extend(n)
        values = [surface.coefficient(n) for surface in self._surfaces]
        for node in self._nodes:
            node.forget(n)
        return values

    def values(self) -> list[Number]:
        """Return the values of the surfaces at the start of the series."""
        return [surface.coefficient(0) for surface in self._surfaces]

    def unknowns_for(self, rates: list[Number]) -> list[Number]:
        """Return the changes of the unknowns that cancel given rates of the surfaces."""
        return [-value for value in self._solve(self._product, rates)]

    def reach_of(self, unknowns: Sequence[Number]) -> Number:
        """Return the largest rate of a surface for unknowns of the given sizes."""
        return max(abs(a * u) for row in self._product for a, u in zip(row, unknowns, strict=True))

    def pin_changes(self, values: list[Number]) -> list[Number]:
        """Return corrections of states that make the given surface coefficients zero."""
        return self._solve([[row[i] for i in self.pins] for row in self._slopes], values)

    def coupled(self, index: int) -> set[int]:
        """Return the surfaces that an unknown couples with a given surface."""
        product = self._product
        return {j for j in range(len(product)) if product[index][j] != 0 or product[j][index] != 0}

    def _find_slopes(self) -> None:
        """Compute the slope of each surface with respect to each state, from first-order coefficients."""
        zero, one = self.context.zero, self.context.one
        rows = []
        for i in range(-1, len(self._states)):
            for k, state in enumerate(self._states):
                state.c[1:] = [one if k == i else zero]
            rows.append(self.coefficients(1))
        for state in self._states:
            state.forget(1)
        self._slopes = [[row[j] - rows[0][j] for row in rows[1:]] for j in range(len(self._surfaces))]

    def _choose_pins(self) -> list[int]:
        """Choose one unknown state for each surface, by elimination with the largest pivots."""
        moved = [any(effect[i] != 0 for effect in self._effects) for i in range(len(self._states))]
        rows = [
            [slope if moves else 0 * slope for slope, moves in zip(row, moved, strict=True)]
            for row in self._slopes
        ]
        pins = [-1] * len(rows)
        for _ in rows:
            size, j, i = max(
                (abs(value), j, i) for j, row in enumerate(rows) if pins[j] < 0 for i, value in enumerate(row)
            )
            if size == 0:
                raise self._powerless(self.names[j])
            pins[j] = i
            for k, row in enumerate(rows):
                if pins[k] < 0 and row[i] != 0:
                    factor = row[i] / rows[j][i]
                    rows[k] = [a - factor * b for a, b in zip(row, rows[j], strict=True)]
                    rows[k][i] = self.context.zero
        return pins

    def _solve(self, matrix: list[list[Number]], right: list[Number]) -> list[Number]:
        if len(right) == 1:
            if matrix[0][0] == 0:
                raise self._powerless(self.names[0])
            return [right[0] / matrix[0][0]]
        try:
            return list(self.context.lu_solve(self.context.matrix(matrix), self.context.matrix(right)))
        except ZeroDivisionError:
            raise UsageError(
                f"the holding forces {', '.join(self.names)} are not unique",
                remedy="merge contacts that have the same relative velocity",
            ) from None

    def _powerless(self, name: str) -> UsageError:
        return UsageError(
            f"the force {name} does not act on the velocity of its own contact",
            remedy="use this force in the rate of the velocity",
        )
