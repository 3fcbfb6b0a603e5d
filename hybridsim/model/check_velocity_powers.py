"""Checks that a flow has a value while a contact slips either way: no fractional power of its velocity itself."""

from __future__ import annotations

from hybridsim.errors import ModelError
from hybridsim.model.scope import Scope
from hybridsim.model.velocity_powers import velocity_powers


def check_velocity_powers(scope: Scope) -> None:
    """Report powers such as v**1.5 of a velocity that is of either sign, in the modes slip+ and slip-."""
    try:
        found = velocity_powers(scope.model)
    except ModelError:
        return  # a parameter without a value, which the check of values reports
    for power in found:
        if power.is_signed:
            message = (
                f"'{power.text}' in {power.where} has no value in one direction of slip: it is a fractional power of "
                f"the velocity of contact {power.contact}, which is of either sign"
            )
            scope.errors.append(ModelError(message, place=power.place, remedy=f"{power.remedy}."))
