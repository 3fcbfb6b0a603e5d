"""This module solves the linear equations of a program by elimination, and finds gaps that depend on each other."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from hybridsim.engine.lowering.lowering_state import LoweringState
from hybridsim.engine.lowering.program import Assign, Item
from hybridsim.expr.simplify import simplified

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


def never_all_zero(
    lowering: LoweringState, surfaces: Mapping[tuple[int, int], Any]
) -> set[tuple[int, int]] | None:
    """Return the constraints of gaps that are linearly dependent, but can never all be zero.

    The result is None if other surfaces are linearly dependent, or gaps that can all be zero.

    Parameters
    ----------
    surfaces : functions by component, and 0 for the function itself, 1 for the rate of a gap.
    """
    sp, states, found = lowering.sp, lowering.states, set()
    slopes = sp.Matrix([[sp.diff(surface, x) for x in states] for surface in surfaces.values()])
    if slopes.free_symbols & set(states):
        return set()
    for weights in slopes.T.nullspace():
        members = [(c, weight) for c, weight in zip(surfaces, weights, strict=True) if weight != 0]
        if any(k == 1 for (_, k), _ in members):
            continue  # the rates of gaps, which are held together with the gaps
        apart = simplified(sp.Add(*(weight * surfaces[c] for c, weight in members)))
        are_gaps = all(lowering.components[c].surface.is_unilateral for (c, _), _ in members)
        if not are_gaps or apart == 0 or not apart.free_symbols <= lowering.parameters:
            return None
        found |= {(c, k) for (c, _), _ in members for k in (0, 1)}
    return found & set(surfaces)
