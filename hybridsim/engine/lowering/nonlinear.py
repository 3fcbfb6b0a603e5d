"""This module creates the error messages for forces and relays that enter the rates nonlinearly."""

from __future__ import annotations

from typing import Any

from hybridsim.engine.lowering.lowering_state import LoweringState
from hybridsim.engine.lowering.program_names import declared_name
from hybridsim.errors import ModelError
from hybridsim.expr.simplify import simplified


def refuse_powers(lowering: LoweringState, unknown: dict[int, Any], rates: list[Any]) -> None:
    """Raise an error if a rate is nonlinear in the sign of a surface, because Filippov's rates would differ."""
    for c, u in unknown.items():
        for x, rate in zip(lowering.states, rates, strict=True):
            component = lowering.components[c]
            if u in rate.free_symbols and u in simplified(lowering.sp.diff(rate, u)).free_symbols:
                name = declared_name(u)
                raise ModelError(
                    f"surface {component.name}: {name} enters the rate of {declared_name(x)} nonlinearly",
                    place=lowering.place(c),
                    remedy=f"let {name} enter the rates linearly, or declare rates for both sides ('above', 'below')",
                )


def nonlinear(lowering: LoweringState, c: int, d: int, others: set[Any]) -> ModelError:
    """Return the error for an unknown that acts on a surface through a power or a product of unknowns."""
    unknown = lowering.symbols[lowering.components[d].surface.unknown]
    name, component = declared_name(unknown), lowering.components[c]
    if not component.surface.unique:
        return ModelError(
            f"the force {name} enters the motion of {component.name} nonlinearly, so the solver cannot determine it",
            place=lowering.place(c),
            remedy="write the derivative of the velocity so that it is linear in the force",
        )
    partners = sorted({name, *map(declared_name, others)})
    if len(partners) == 1:
        message = f"{name} enters the rate of the switching function '{lowering.written(c)}' nonlinearly"
        remedy = f"let {name} enter the rates linearly, or declare rates for both sides ('above', 'below')"
    else:
        message = (
            f"{' and '.join(partners)} multiply each other in the rate of the switching function "
            f"'{lowering.written(c)}': at the intersection of their surfaces the sliding motion is not unique"
        )
        remedy = (
            f"write the rates as sums of terms with one of {', '.join(partners)} in each, or declare modes"
        )
    return ModelError(f"surface {component.name}: {message}", place=lowering.place(c), remedy=remedy)
