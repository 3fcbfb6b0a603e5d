"""This module checks all expressions: names, kinds of values, cyclic definitions and size."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from hybridsim.errors import ExpressionError, ModelError
from hybridsim.expr import Expression, evaluate, substitute
from hybridsim.expr.evaluate import CyclicDependency, dependency_order
from hybridsim.expr.grammar import MAX_DERIVED_NODES
from hybridsim.model.checks.scope import Scope
from hybridsim.model.parts.component import Component

Item = tuple[str, Expression, bool]


def check_expressions(scope: Scope) -> None:
    """Report unknown names, wrong kinds, cyclic definitions, and definitions that become too large."""
    check_before_run(scope)
    items = list(_of_everything(scope))
    for what, expr, boolean in items:
        scope.need(expr, what, scope.all_names, boolean=boolean)
    if not scope.errors:
        _circles(scope)
    if not scope.errors:
        _constants(scope, items)


def check_before_run(scope: Scope) -> None:
    """Report errors in expressions that are evaluated before a run."""
    for what, expr in _of_parameters(scope):
        if expr.names or expr.is_boolean:  # all others are numbers
            scope.need(expr, what, scope.parameters)


def _of_parameters(scope: Scope) -> Iterator[tuple[str, Expression]]:
    """Yield the expressions that are evaluated before a run, which may use only parameters."""
    model = scope.model
    for parameter in model.parameters:
        yield f"parameter {parameter.name}", parameter.value
    if model.duration is not None:
        yield "duration", model.duration
    for state in model.states:
        yield f"state {state.name}, start", state.start
    for discrete in model.discrete:
        yield f"discrete state {discrete.name}, start", discrete.start
    for schedule in model.schedules:
        for index, time in enumerate(schedule.times):
            yield f"schedule {schedule.name}, times[{index}]", time
        for field in ("start", "period"):
            if getattr(schedule, field) is not None:
                yield f"schedule {schedule.name}, {field}", getattr(schedule, field)
    for signal in model.inputs:
        for field, expr in signal.expressions.items():
            yield f"input {signal.name}, {field}", expr


def _of_everything(scope: Scope) -> Iterator[Item]:
    """Yield the expressions that may use all names of the model."""
    model = scope.model
    for state in model.states:
        yield f"state {state.name}, der", state.der, False
    for name, expr in model.definitions:
        yield f"definition {name}", expr, False
    for component in model.components:
        yield from _of_component(component)
    for monitor in model.monitors:
        yield f"monitor {monitor.name}", monitor.expr, False
        for name, expr in monitor.reset.items():
            yield f"monitor {monitor.name}, reset of {name}", expr, False
    for schedule in model.schedules:
        for name, expr in schedule.reset.items():
            yield f"schedule {schedule.name}, reset of {name}", expr, False
    for output in model.outputs:
        yield f"output {output.name}", output.expr, False
        for key, expr in output.modes.items():
            yield f"output {output.name} in {key}", expr, False
    for shape in model.drawing:
        for where, expr in shape.expressions():
            yield f"shape {shape.name}, {where}", expr, False


def _of_component(component: Component) -> Iterator[Item]:
    head = f"component {component.name}"
    surface = component.surface
    if surface is not None:
        for field in ("function", "jump_above", "jump_below"):
            yield f"{head}, surface {field}", getattr(surface, field), False
    if component.limit is not None:
        for name, expr in component.limit.reset.items():
            yield f"{head}, limit, reset of {name}", expr, False
    for mode in component.modes:
        where = f"{head}, mode {mode.name}"
        for name, expr in mode.der.items():
            yield f"{where}, der of {name}", expr, False
        for name, expr in mode.set.items():
            yield f"{where}, set {name}", expr, False
        for guard in mode.guards:
            yield f"{where}, guard {guard.name}", guard.expr, False
            for choice in guard.then:
                if choice.when is not None:
                    yield f"{where}, guard {guard.name}, when", choice.when, True
                for name, expr in choice.reset.items():
                    yield f"{where}, guard {guard.name}, reset of {name}", expr, False


def _circles(scope: Scope) -> None:
    """Report definitions and variables that depend on themselves in any mode, or become too large."""
    model = scope.model
    edges: dict[str, list[Expression]] = {name: [expr] for name, expr in model.definitions}
    for component in scope.components:
        for mode in component.modes:
            for name, expr in mode.set.items():
                edges.setdefault(name, []).append(expr)
    over_modes = {name: _over_modes(exprs) for name, exprs in edges.items()}
    try:
        order = dependency_order(over_modes, "definitions and variables")
    except CyclicDependency as fault:
        scope.errors.append(_algebraic_loop(fault))
        return
    sizes: dict[str, int] = {}
    for name in order:
        sizes[name] = max(_size(expr, sizes) for expr in edges[name])
        if sizes[name] > MAX_DERIVED_NODES:
            message = f"'{name}' has {sizes[name]} terms after its definitions are inserted"
            remedy = f"at most {MAX_DERIVED_NODES} are allowed; nest the definitions less"
            scope.errors.append(edges[name][0].error(message, remedy=remedy))
            return


def _algebraic_loop(fault: CyclicDependency) -> ExpressionError:
    """Return the error for a cyclic definition; a cycle through several parts is called an algebraic loop."""
    if not any("." in name for name in fault.circle):
        return fault
    return ExpressionError(
        f"algebraic loop through parts: {' -> '.join(fault.circle)}",
        place=fault.place,
        remedy="each of these values is computed from the others at the same instant; connect a state instead of one "
        "of them, or write the equations of the loop in one part",
    )


def _over_modes(exprs: list[Expression]) -> Expression:
    """Return an expression that has the dependencies of several expressions together."""
    first = exprs[0]
    return Expression(first.text, frozenset().union(*(expr.names for expr in exprs)), first.place, first.tree)


def _size(expr: Expression, sizes: dict[str, int]) -> int:
    total = 0
    for node in ast.walk(expr.tree):
        if isinstance(node, ast.expr):
            total += sizes.get(node.id, 1) if isinstance(node, ast.Name) else 1
    return total


def _constants(scope: Scope, items: list[Item]) -> None:
    """Report expressions that exceed a limit after constants are inserted, such as a large power."""
    known: dict[str, Expression | str | float] = {}
    definitions = dict(scope.model.definitions)
    for name in dependency_order(definitions, "definitions"):
        expr = definitions[name]
        if expr.names <= known.keys():
            try:
                known[name] = evaluate(substitute(expr, known), {})
            except ModelError as fault:
                scope.errors.append(fault)
                return
    for what, expr, _ in items:
        try:
            substitute(expr, known)
        except ExpressionError as fault:
            message = f"{what}: {fault.message}"
            scope.errors.append(ExpressionError(message, place=fault.place, remedy=fault.remedy))
