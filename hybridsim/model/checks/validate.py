"""This module runs all checks of a model and collects the errors."""

from __future__ import annotations

from hybridsim.errors import ModelError
from hybridsim.model.checks.automata import check_automata
from hybridsim.model.checks.contacts import check_contacts
from hybridsim.model.checks.drawing import check_drawing
from hybridsim.model.checks.expressions import check_before_run, check_expressions
from hybridsim.model.checks.functions import check_functions
from hybridsim.model.checks.impacts import check_impacts
from hybridsim.model.checks.names import check_names
from hybridsim.model.checks.scope import Scope
from hybridsim.model.checks.signals import check_signals
from hybridsim.model.checks.surfaces import check_surfaces
from hybridsim.model.checks.values import check_values, errors_of_numbers
from hybridsim.model.checks.velocity_powers import check_velocity_powers
from hybridsim.model.checks.whole_numbers import check_whole_numbers
from hybridsim.model.parts.model import Model


def find_errors(model: Model) -> tuple[ModelError, ...]:
    """Return all errors of a model, in the order of the checks.

    The checks of names come first, then those of the structure, then those of the expressions. Values are checked
    only if all of these succeed, because they would repeat the same errors. In a copy of a valid model with other
    values only the values are checked; if only numbers of parameters differ, only what depends on them.
    """
    changed = model.changed_numbers
    if changed is not None:
        return errors_of_numbers(model, changed)
    scope = Scope(model)
    if model.is_known_to_be_sound:
        check_before_run(scope)
        if not scope.errors:
            check_values(scope)
        return tuple(scope.errors)
    check_names(scope)
    check_automata(scope)
    check_contacts(scope)
    check_surfaces(scope)
    check_impacts(scope)
    check_signals(scope)
    check_functions(scope)
    check_drawing(scope)
    check_expressions(scope)
    if not scope.errors:
        check_whole_numbers(scope)
    if not scope.errors:
        check_velocity_powers(scope)
    if not scope.errors:
        model.once("is sound", lambda: True)
        check_values(scope)
    return tuple(scope.errors)
