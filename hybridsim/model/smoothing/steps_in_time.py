"""This module represents conditions on time as signals: 1 if true, 0 if false.

In a rate such a condition becomes a component, which the compiled loop passes without stopping. In the velocity of a
contact, a load, a law, a gap or a guard it becomes a signal, whose jumps are treated like those of an input. Its times
may depend on parameters, on discrete states that no reset changes, and on constant inputs.
"""

from __future__ import annotations

import ast
from collections.abc import Set
from dataclasses import dataclass

from hybridsim.expr import Expression, of_tree, parse, substitute
from hybridsim.expr.grammar import TIME
from hybridsim.expr.polynomial import difference
from hybridsim.expr.rebuild import exchanged, with_names
from hybridsim.model.parts.inputs import HeldInput, Input
from hybridsim.model.parts.model import Model
from hybridsim.model.smoothing.one_sided import names_of

STEP = "__step_"  # prefix of the name of a signal; declared names cannot start with two underscores
_ZERO, _ONE = ast.Constant(0), ast.Constant(1)


@dataclass(frozen=True)
class TimeStep(Input):
    """A signal that is 1 while a linear or sinusoidal function of time is positive, otherwise 0.

    Parameters
    ----------
    shift, rate, amplitude, phase, period : Expression
        Expressions of parameters and of the constants of `lasting`; the last three only for the sine.
    title : str
        Source text of the expression.
    """

    shift: Expression | None = None
    rate: Expression | None = None
    title: str = ""

    @property
    def subject(self) -> str:
        """The name of the signal in messages."""
        return f"the condition on '{self.title}'"

    @property
    def expressions(self) -> dict[str, Expression]:
        """The fields of the signal that are expressions of parameters, by name."""
        fields = ("shift", "rate", "amplitude", "phase", "period")
        return {name: getattr(self, name) for name in fields if getattr(self, name) is not None}


def constant_inputs(model: Model) -> dict[str, float]:
    """Return the inputs that are tables with the same value at all times."""
    tables = (signal for signal in model.inputs if signal.kind == "table")
    return {table.name: table.values[0] for table in tables if len(set(table.values)) == 1}


def lasting(model: Model) -> frozenset[str]:
    """Return the names that are constant during a run: discrete states without resets, and constant inputs."""
    choices = [choice for c in model.components for m in c.modes for g in m.guards for choice in g.then]
    resets = [choice.reset for choice in choices]
    resets += [part.reset for part in model.monitors] + [part.reset for part in model.schedules]
    constants = (part.name for part in model.discrete if not isinstance(part, HeldInput))
    return frozenset(constants).difference(*resets) | constant_inputs(model).keys()


def step_of(name: str, argument: ast.expr, parameters: Set[str], title: str) -> TimeStep | None:
    """Return the signal that is 1 while a function of time is positive, or None if unsupported."""
    if linear := _linear(argument, TIME, parameters):
        return TimeStep(name, "step", shift=of_tree(linear[0]), rate=of_tree(linear[1]), title=title)
    for part in ast.walk(argument):
        match part:
            case ast.Call(func=ast.Name(id="sin" | "cos" as function), args=[angle]) if TIME in names_of(
                angle
            ):
                place = ast.Name("__wave", ast.Load())
                whole = _linear(exchanged(argument, part, place), place.id, parameters)
                turning = _linear(angle, TIME, parameters)
                if whole is None or turning is None:
                    return None
                begin = turning[0]
                if function == "cos":
                    begin = ast.BinOp(begin, ast.Add(), parse("pi/2").tree)
                shift, amplitude = map(of_tree, whole)
                phase, rate = map(of_tree, (begin, turning[1]))
                period = substitute(parse("2*pi/abs(rate)"), {"rate": rate})
                return TimeStep(
                    name,
                    "step",
                    shift=shift,
                    amplitude=amplitude,
                    phase=phase,
                    rate=rate,
                    title=title,
                    period=period,
                )
    return None


def _linear(tree: ast.expr, name: str, parameters: Set[str]) -> tuple[ast.expr, ast.expr] | None:
    """Return a and b of an expression a + b*name, or None if it has another form."""
    shift, at_one = (with_names(tree, {name: value}) for value in (_ZERO, _ONE))
    slope = ast.BinOp(at_one, ast.Sub(), shift)
    if not names_of(shift) <= parameters:
        return None
    line = ast.BinOp(shift, ast.Add(), ast.BinOp(slope, ast.Mult(), ast.Name(name, ast.Load())))
    return None if difference(tree, line) else (shift, slope)
