"""This module checks where floor, mod and round stand, because they jump, and the divisors of mod."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from hybridsim.expr import Expression, of_tree
from hybridsim.expr.walk import stairs_in
from hybridsim.expr.write import write
from hybridsim.model.checks.scope import Scope
from hybridsim.model.parts.declared import Declared
from hybridsim.model.parts.model import Model
from hybridsim.model.smoothing.one_sided import names_of
from hybridsim.model.smoothing.whole_numbers import model_expressions

_HELD = "use a discrete state that a monitor or a schedule resets, or an input of kind 'wave' or 'table'"


def check_whole_numbers(scope: Scope) -> None:
    """Report floor, mod and round where they are not supported, and divisors of mod that vary."""
    for part, what, expr, remedy in _without_jumps(scope.model):
        for call in _stairs_behind(scope, expr):
            scope.fail(part, f"{what} contains '{write(call)}', which jumps", remedy)
            break
    constants = scope.model.constant_names()
    for expr in model_expressions(scope.model):
        for call in stairs_in(expr.tree):
            _argument(scope, expr, call)
            if (
                ast.unparse(call.func) == "mod"
                and len(call.args) == 2
                and not names_of(call.args[1]) <= constants
            ):
                scope.errors.append(
                    expr.error(
                        f"the divisor of '{write(call)}' is not constant",
                        node=call,
                        remedy="use parameters and numbers, or write x - d*floor(x/d) with a d that is never zero",
                    )
                )


def divisors(model: Model) -> Iterator[Expression]:
    """Yield the divisors of mod in a model."""
    for expr in model_expressions(model):
        for call in stairs_in(expr.tree):
            if ast.unparse(call.func) == "mod":
                yield of_tree(call.args[1], expr.place)


def _argument(scope: Scope, expr: Expression, call: ast.Call) -> None:
    """Report an argument that depends on the force of a contact or on the unknown of a surface."""
    unknowns = {component.surface.unknown for component in scope.components if component.surface}
    forces = sorted(scope.reached(of_tree(call)) & unknowns)
    if forces:
        message = (
            f"'{write(call)}' depends on '{forces[0]}', which the solver computes together with the modes"
        )
        scope.errors.append(expr.error(message, node=call, remedy="use states, inputs, parameters and t"))


def _without_jumps(model: Model) -> Iterator[tuple[Declared, str, Expression, str]]:
    """Yield the expressions that may not jump or that are not rewritten, each with its place and a remedy."""
    for contact in model.contacts:
        yield contact, f"contact {contact.name}: the velocity", contact.velocity, _HELD
        remedy = "pass the jumping value as an argument of the law"
        for field, expr in contact.law.expressions():
            yield contact, f"law {contact.law.name}, {field},", expr, remedy
        for name, value in contact.law.parameters.items():
            if value is not None:
                yield contact, f"law {contact.law.name}, {name},", value, remedy
    for surface in model.surfaces:
        yield surface, f"surface {surface.name}: the switching function", surface.expr, _HELD
    for impact in model.impacts:
        yield impact, f"impact {impact.name}: the gap", impact.gap, _HELD
        yield impact, f"impact {impact.name}: the restitution", impact.restitution, _HELD
    for component in model.components:
        if component.surface is not None:
            yield component, f"component {component.name}: the surface", component.surface.function, _HELD
    for signal in model.inputs:
        for field, expr in signal.expressions.items():
            yield signal, f"input {signal.name}: '{field}'", expr, "declare a parameter with this value"
    for shape in model.drawing:
        for where, expr in shape.expressions():
            yield shape, f"shape {shape.name}, {where}", expr, "declare a definition with this value"


def _stairs_behind(scope: Scope, expr: Expression) -> Iterator[ast.Call]:
    """Yield the calls of floor, mod and round in an expression and in all that it depends on."""
    yield from stairs_in(expr.tree)
    reached = scope.reached(expr)
    for name, other in scope.model.definitions:
        if name in reached:
            yield from stairs_in(other.tree)
    for component in scope.components:
        for mode in component.modes:
            for name, other in mode.set.items():
                if name in reached:
                    yield from stairs_in(other.tree)
