"""Checks of switching surfaces: what their function and their variables may use."""

from __future__ import annotations

from hybridsim.model.nonsmooth import has_word
from hybridsim.model.scope import Scope
from hybridsim.model.switching import SwitchingSurface


def check_surfaces(scope: Scope) -> None:
    """Report switching functions that depend on a mode or on no state, and variables over unknown names."""
    for surface in scope.model.surfaces:
        _surface(scope, surface)


def _surface(scope: Scope, surface: SwitchingSurface) -> None:
    what = f"surface {surface.name}"
    scope.need(surface.expr, f"{what}, expr", scope.all_names - {surface.name})
    known = scope.all_names - {surface.name, *surface.above}
    for side in ("above", "below"):
        for name, value in getattr(surface, side).items():
            scope.need(value, f"{what}, {side}, {name}", known)
    reached = scope.reached(surface.expr)
    if not reached <= scope.all_names:
        return
    switched = sorted(filter(scope.is_switched, reached))
    if switched:
        message = f"{what}: the switching function depends on '{switched[0]}', which depends on a mode"
        scope.fail(surface, message, "write it over states, discrete states, parameters and t.")
    elif any(map(has_word, [surface.expr, *(e for n, e in scope.model.definitions if n in reached)])):
        message = f"{what}: the switching function '{surface.expr.text}' is not smooth"
        scope.fail(
            surface, message, "write one without abs, min, max, sign and conditions, or modes with guards."
        )
    elif not any(scope.kinds.get(name) == "state" for name in reached):
        message = f"{what}: the switching function '{surface.expr.text}' contains no state"
        scope.fail(
            surface, message, "write what is zero on the surface, e.g. 'x'; an input switches by itself."
        )
