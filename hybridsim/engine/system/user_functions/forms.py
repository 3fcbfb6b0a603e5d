"""This module wraps a model's Python functions in the form f(t, x, p, z, out) -> status."""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hybridsim.engine.series.layout import Layout
from hybridsim.errors import ModelError, UsageError
from hybridsim.expr import Expression, FunctionExpression, evaluate, function_name

if TYPE_CHECKING:
    from hybridsim.model.parts.model import Model

Function = Callable[..., Any]


class Scalar(NamedTuple):
    """A number that depends on (t, x, p): a function or a constant, for one mode of a component."""

    component: int
    mode: int
    function: Function | float
    what: str


@dataclass(frozen=True)
class Parts:
    """The Python functions of a model, sorted by their use.

    flows: (mode or -1, function), with the flow of the model last. component: the one whose modes have their own flows.
    """

    component: int
    flows: tuple[tuple[int, Function], ...]
    guards: tuple[Scalar, ...]
    monitors: tuple[Scalar, ...]
    outputs: tuple[Scalar, ...]
    parameters: Any  # named tuple class
    states: int
    origin_at: int


def parts_of(model: Model) -> Parts:
    """Return the functions of a valid model of Python functions."""
    assert model.flow is not None
    names = [p.name for p in model.parameters]
    try:
        # mypy needs literal names for a namedtuple
        parameters = namedtuple("Parameters", names)  # type: ignore[misc]  # its fields are known at run time
    except ValueError as fault:
        message = f"model {model.name}: its functions cannot get the parameters as p.name: {fault}"
        raise UsageError(message, remedy="rename that parameter") from None
    component, flows, guards = -1, [], []
    for c, automaton in enumerate(model.all_components()):
        for m, mode in enumerate(automaton.modes):
            if mode.flow is not None:
                component = c
                flows.append((m, mode.flow))
            guards += [
                Scalar(c, m, value(g.expr), f"guard {g.name} of {automaton.name}.{mode.name}")
                for g in mode.guards
            ]
    monitors = [Scalar(-1, 0, value(m.expr), f"monitor {m.name}") for m in model.monitors]
    outputs = [Scalar(-1, 0, value(o.expr), f"output {o.name}") for o in model.outputs]
    return Parts(
        component,
        (*flows, (-1, model.flow)),
        tuple(guards),
        tuple(monitors),
        tuple(outputs),
        parameters,
        len(model.states),
        Layout(len(names), 0, 0, 0).origin_at,
    )


def value(expr: Expression) -> Function | float:
    """Return an expression as a Python function, or as a number if it is constant."""
    return expr.function if isinstance(expr, FunctionExpression) else evaluate(expr, {})


class Failures:
    """The last exception that a user's function raised in a run; the function's value is then NaN."""

    def __init__(self) -> None:
        self.last = ""

    def note(self, function: Function, t: float, fault: Exception, on_the_run: bool) -> None:
        """Store an exception that was raised at a point of the run, not in a finite difference."""
        if on_the_run:
            self.last = (
                f"the function {function_name(function)} raised {type(fault).__name__}: {fault} at t = {t!r}"
            )


class Forms:
    """The Python form of all functions of a model; a call that raises an exception gives NaN."""

    def __init__(self, parts: Parts) -> None:
        self.parts, self.failures = parts, Failures()

    def arguments(self, s: float, x: Any, p: Any) -> tuple[float, np.ndarray, Any]:
        """Return (t, x, p) for the user's functions; x is a copy that they may modify."""
        parts = self.parts
        count = len(parts.parameters._fields)
        state = np.array(x[: parts.states], dtype=float)
        return float(p[parts.origin_at] + s), state, parts.parameters(*(float(v) for v in p[:count]))

    def flow(self, s: float, x: Any, p: Any, z: Any, out: Any) -> int:
        """Write the rates in the modes `z` to `out`."""
        parts, function = self.parts, self.flow_of(z)
        t, state, named = self.arguments(s, x, p)
        try:
            out[: parts.states] = rates(function, parts.states, t, state, named).tolist()
        except Exception as fault:  # user code may raise anything; reported when the step is judged
            self.failures.note(function, t, fault, bool(p[parts.origin_at + 1]))
            out[: parts.states] = [math.nan] * parts.states
            return 1
        return 0

    def flow_of(self, z: Any) -> Function:
        """Return the user's function that computes the rates in the modes `z`."""
        mode = z[self.parts.component] if self.parts.component >= 0 else -1
        return next(f for m, f in self.parts.flows if m in (mode, -1))

    def row(self, scalars: tuple[Scalar, ...]) -> Function:
        """Return one function that writes several numbers; a number whose mode is inactive becomes 1."""

        def form(s: float, x: Any, p: Any, z: Any, out: Any) -> int:
            status = 0
            for k, scalar in enumerate(scalars):
                out[k] = 1.0
                if scalar.component < 0 or z[scalar.component] == scalar.mode:
                    out[k] = self.number(scalar.function, s, x, p)
                    status |= math.isnan(out[k])
            return int(status)

        return form

    def number(self, function: Function | float, s: float, x: Any, p: Any) -> float:
        """Return the value of one user function."""
        if not callable(function):
            return function
        t, state, named = self.arguments(s, x, p)
        try:
            return number(function, t, state, named)
        except Exception as fault:  # user code may raise anything; reported when the step is judged
            self.failures.note(function, t, fault, bool(p[self.parts.origin_at + 1]))
            return math.nan


def rates(function: Function, count: int, t: float, x: np.ndarray, p: Any) -> np.ndarray:
    """Return the result of a flow as an array; raise an error if the result is not n numbers."""
    returned = function(t, x, p)
    found = _array(returned)
    if found is None or found.shape != (count,):
        raise ModelError(
            f"the flow {function_name(function)} must return {count} numbers, but returned {_shown(returned)}",
            remedy=f"return {count} numbers, the rate of each state in order, as a tuple or an array",
        )
    return found


def number(function: Function, t: float, x: np.ndarray, p: Any) -> float:
    """Return the result of a scalar function; raise an error if the result is not a number."""
    returned = function(t, x, p)
    found = _array(returned)
    if found is None or found.shape != ():
        raise ModelError(
            f"the function {function_name(function)} returned {_shown(returned)}", remedy="return one number"
        )
    return float(found)


def _array(returned: Any) -> np.ndarray | None:
    """Return real numbers as an array, or None for other values."""
    try:
        found = np.asarray(returned)
    except ValueError:  # rows of unequal length
        return None
    return found.astype(float) if found.dtype.kind in "biuf" else None


def _shown(returned: Any) -> str:
    found = _array(returned)
    if found is None or not found.ndim:
        text = repr(returned if found is None else found.item())
        return text if len(text) <= 60 else f"{text[:57]}..."
    return f"{type(returned).__name__} of shape {found.shape}"
