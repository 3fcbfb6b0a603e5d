"""This module checks impacts: the gap and the coefficient of restitution."""

from __future__ import annotations

from collections.abc import Mapping

from hybridsim.expr import evaluate
from hybridsim.model.checks.scope import Findings, Scope
from hybridsim.model.checks.smooth import Remedies, need_smooth
from hybridsim.model.parts.impact import ROUNDING, SPEED, Impact

_REMEDIES = Remedies(
    switched="use only states, parameters and t",
    not_smooth="declare one impact for each smooth piece",
    no_state="write the distance between the bodies, e.g. 'h' or 'x2 - x1 - d'",
)


def check_impacts(scope: Scope) -> None:
    """Report gaps that depend on a mode, contain no state or have corners, and invalid restitutions."""
    for impact in scope.model.impacts:
        _impact(scope, impact)


def _impact(scope: Scope, impact: Impact) -> None:
    what = f"impact {impact.name}"
    scope.need(impact.gap, f"{what}, gap", scope.all_names - {impact.name})
    names = (scope.all_names - {impact.name}) | {SPEED}
    scope.need(impact.restitution, f"{what}, restitution", names)
    if SPEED in scope.kinds and SPEED in impact.restitution.names:
        message = (
            f"{what}, restitution: '{SPEED}' is the approach speed here, but also a {scope.kinds[SPEED]}"
        )
        scope.fail(impact, message, f"rename the {scope.kinds[SPEED]}")
    switched = sorted(filter(scope.is_switched, scope.reached(impact.restitution) & scope.all_names))
    if switched:
        message = f"{what}: the restitution depends on '{switched[0]}', which depends on a mode"
        scope.fail(impact, message, f"use only {SPEED}, states and parameters")
    need_smooth(scope, impact, f"{what}: the gap", impact.gap, _REMEDIES)


def check_restitution(scope: Findings, impact: Impact, values: Mapping[str, float]) -> None:
    """Report a constant restitution outside 0 to 1."""
    if impact.restitution.names <= values.keys():
        e = evaluate(impact.restitution, values)
        if not -ROUNDING <= e <= 1.0 + ROUNDING:
            message = f"impact {impact.name}: the restitution '{impact.restitution.text}' cannot be {e!r}"
            scope.fail(impact, message, "use a number from 0 (no rebound) to 1 (no energy loss)")
