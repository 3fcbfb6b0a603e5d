"""This module solves the linear equations of a program by elimination."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from hybridsim.engine.lowering.program import Assign, Item

Row = TypeVar("Row")


def eliminated(
    order: Sequence[Row],
    unknown: dict[Row, Any],
    matrix: dict[tuple[Row, Row], Any],
    right: dict[Row, Any],
    prefix: str = "",
    label: Callable[[Row], str] = str,
) -> list[Item]:
    """Return the program items of a Gaussian elimination without pivoting.

    The effects of forces on accelerations are definite, and the effects of relays that hold their surfaces
    have positive principal minors.
    """
    items: list[Item] = []

    def fresh(name: str, value: Any) -> Any:
        from sympy import Symbol

        items.append(Assign(name, value))
        return Symbol(name, real=True)

    for a, c in enumerate(order):
        for d in order[a + 1 :]:
            if (d, c) not in matrix:
                continue
            factor = fresh(f"{prefix}factor_{label(d)}_{label(c)}", matrix.pop((d, c)) / matrix[c, c])
            for e in order[a + 1 :]:
                if (c, e) in matrix:
                    value = matrix.get((d, e), 0) - factor * matrix[c, e]
                    matrix[d, e] = fresh(f"{prefix}pivot_{a}_{label(d)}_{label(e)}", value)
            right[d] = fresh(f"{prefix}right_{a}_{label(d)}", right[d] - factor * right[c])
    for a in reversed(range(len(order))):
        c = order[a]
        value = right[c]
        for d in order[a + 1 :]:
            if (c, d) in matrix:
                value -= matrix[c, d] * unknown[d]
        items.append(Assign(unknown[c].name, value / matrix[c, c]))
    return items
