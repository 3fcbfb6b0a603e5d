"""Checks of Python functions in a model: all or none, and nothing beside them that needs expressions."""

from __future__ import annotations

from collections.abc import Iterator

from hybridsim.expr import Expression, FunctionExpression
from hybridsim.model.declared import Declared
from hybridsim.model.monitor import Monitor
from hybridsim.model.schedule import Schedule
from hybridsim.model.scope import Scope

_NEED_EXPRESSIONS = ("contacts", "surfaces", "impacts", "inputs", "discrete", "definitions")


def check_functions(scope: Scope) -> None:
    """Report functions in a model of expressions, and what a model of functions cannot have."""
    model = scope.model
    modes = [(c, mode) for c in model.components for mode in c.modes]
    if model.flow is None:
        for part, what, expr in _uses(scope):
            if isinstance(expr, FunctionExpression):
                remedy = "write it as an expression, or give the rates as a function too: Model(flow=...)."
                scope.fail(
                    part, f"{what} is the Python function {expr}, and the rates are expressions", remedy
                )
        for component, mode in modes:
            if mode.flow is not None:
                message = f"mode {component.name}.{mode.name} has a flow, and the model has none"
                scope.fail(mode, message, "give the model a flow, or write the mode's rates as der = {...}.")
        return
    for field in _NEED_EXPRESSIONS:
        if getattr(model, field):
            message = f"the rates are a Python function, and the model has {field}"
            scope.fail(Declared(), message, f"{field} need rates by expressions: give each state its der.")
    for state in model.states:
        if state.der.text not in ("0", "0.0"):
            message = f"state {state.name} has der = '{state.der}', and the rates are the function flow"
            scope.fail(state, message, "leave it at 0.")
    for component, mode in modes:
        if mode.der or mode.set or component.surface:
            message = f"component {component.name}: 'der', 'set' and surfaces need rates by expressions"
            scope.fail(mode, message, "give the mode a flow.")
    if len({component.name for component, mode in modes if mode.flow is not None}) > 1:
        message = "modes of several components have a flow: which holds?"
        scope.fail(Declared(), message, "let the modes of one component have it.")
    for part, what, expr in _uses(scope):
        if not isinstance(expr, FunctionExpression) and not expr.is_constant:
            message = f"{what} is the expression '{expr}', and the rates are a Python function"
            scope.fail(part, message, "give a function of (t, x, p) there too, or a number.")
    for output in model.outputs:
        if output.modes:
            message = f"output {output.name}: forms by mode need expressions"
            scope.fail(output, message, "let it be one function.")


def _uses(scope: Scope) -> Iterator[tuple[Declared, str, Expression]]:
    """Every place where a function may stand: the part, the place in words, what stands there."""
    model = scope.model
    for component in model.components:
        if component.limit is not None:
            for name, expr in component.limit.reset.items():
                yield component.limit, f"limit of {component.name}, reset of {name}", expr
        for mode in component.modes:
            for guard in mode.guards:
                what = f"guard {guard.name} of {component.name}.{mode.name}"
                yield guard, what, guard.expr
                for choice in guard.then:
                    if choice.when is not None:
                        yield choice, f"{what}, when", choice.when
                    for name, expr in choice.reset.items():
                        yield choice, f"{what}, reset of {name}", expr
    parts: tuple[Monitor | Schedule, ...] = (*model.monitors, *model.schedules)
    for part in parts:
        what = f"{type(part).__name__.lower()} {part.name}"
        for name, expr in part.reset.items():
            yield part, f"{what}, reset of {name}", expr
    for monitor in model.monitors:
        yield monitor, f"monitor {monitor.name}", monitor.expr
    for output in model.outputs:
        yield output, f"output {output.name}", output.expr
