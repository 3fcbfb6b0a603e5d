"""This module checks models with Python functions, which must not be mixed with expressions."""

from __future__ import annotations

from collections.abc import Iterator

from hybridsim.expr import Expression, FunctionExpression
from hybridsim.model.checks.scope import Scope
from hybridsim.model.parts.declared import Declared
from hybridsim.model.parts.monitor import Monitor
from hybridsim.model.parts.schedule import Schedule

_NEED_EXPRESSIONS = ("contacts", "surfaces", "impacts", "inputs", "discrete", "definitions")


def check_functions(scope: Scope) -> None:
    """Report functions in a model with expressions, and unsupported parts in a model with functions."""
    model = scope.model
    modes = [(c, mode) for c in model.components for mode in c.modes]
    if model.flow is None:
        for part, what, expr in _uses(scope):
            if isinstance(expr, FunctionExpression):
                remedy = "write an expression, or define the rates by a function too: Model(flow=...)"
                scope.fail(
                    part, f"{what} is the Python function {expr}, but the rates are expressions", remedy
                )
        for component, mode in modes:
            if mode.flow is not None:
                message = f"mode {component.name}.{mode.name} has a 'flow', but the model has no 'flow'"
                scope.fail(
                    mode, message, "add a 'flow' to the model, or write the rates of the mode as der = {...}"
                )
        return
    for field in _NEED_EXPRESSIONS:
        if getattr(model, field):
            message = f"a model whose rates are a Python function cannot have '{field}'"
            scope.fail(
                Declared(), message, f"to use '{field}', write the rate of each state as an expression (der)"
            )
    for state in model.states:
        if state.der.text not in ("0", "0.0"):
            message = f"state {state.name} has der = '{state.der}', but the function 'flow' defines the rates"
            scope.fail(state, message, "remove 'der', or remove 'flow'")
    for component, mode in modes:
        if mode.der or mode.set or component.surface:
            message = f"component {component.name}: 'der', 'set' and surfaces need rates that are expressions"
            scope.fail(mode, message, "define the rates of the mode by 'flow'")
    if len({component.name for component, mode in modes if mode.flow is not None}) > 1:
        message = "modes of several components have a 'flow', so the rates are ambiguous"
        scope.fail(Declared(), message, "define 'flow' in the modes of one component only")
    for part, what, expr in _uses(scope):
        if not isinstance(expr, FunctionExpression) and not expr.is_constant:
            message = f"{what} is the expression '{expr}', but the rates are a Python function"
            scope.fail(part, message, "use a function of (t, x, p) or a number")
    for output in model.outputs:
        if output.modes:
            message = f"output {output.name} depends on the mode, which needs expressions"
            scope.fail(output, message, "use one function for all modes")


def _uses(scope: Scope) -> Iterator[tuple[Declared, str, Expression]]:
    """Yield each place at which a model can have a function, with its description and expression."""
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
