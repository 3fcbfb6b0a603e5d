"""This module checks switching surfaces: switching functions and variables."""

from __future__ import annotations

from hybridsim.model.checks.scope import Scope
from hybridsim.model.checks.smooth import Remedies, need_smooth
from hybridsim.model.parts.switching import SwitchingSurface

_REMEDIES = Remedies(
    switched="use only states, discrete states, parameters and t",
    not_smooth="write it without abs, min, max, sign and conditions, or use modes with guards",
    no_state="write the function that is zero on the surface, e.g. 'x'; inputs need no surface",
)


def check_surfaces(scope: Scope) -> None:
    """Report invalid switching functions, and unknown names in the variables of the sides."""
    for surface in scope.model.surfaces:
        _surface(scope, surface)


def _surface(scope: Scope, surface: SwitchingSurface) -> None:
    what = f"surface {surface.name}"
    scope.need(surface.expr, f"{what}, expr", scope.all_names - {surface.name})
    known = scope.all_names - {surface.name, *surface.above}
    for side in ("above", "below"):
        for name, value in getattr(surface, side).items():
            scope.need(value, f"{what}, {side}, {name}", known)
    need_smooth(scope, surface, f"{what}: the switching function", surface.expr, _REMEDIES)
