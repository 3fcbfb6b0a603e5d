"""This module checks that no fractional power of a contact velocity is undefined in a slip mode."""

from __future__ import annotations

from hybridsim.errors import ModelError
from hybridsim.model.checks.scope import Scope
from hybridsim.model.laws.velocity_powers import velocity_powers


def check_velocity_powers(scope: Scope) -> None:
    """Report powers such as v**1.5 of a velocity that can be negative."""
    try:
        found = velocity_powers(scope.model)
    except ModelError:
        return  # a parameter has no value; check_values reports it
    for power in found:
        if power.is_signed:
            message = (
                f"'{power.text}' in {power.where} is undefined for negative velocity of contact {power.contact}, "
                "because its exponent is not a whole number"
            )
            scope.errors.append(ModelError(message, place=power.place, remedy=power.remedy))
