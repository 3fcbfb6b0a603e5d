"""This module converts the expressions of a model to nodes, for given modes of its components."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from hybridsim.errors import UsageError
from hybridsim.expr import Expression
from hybridsim.expr.grammar import CONSTANTS, MAX_POWER, TIME
from hybridsim.model import Model
from hybridsim.reference.multiple_precision.functions import Functions
from hybridsim.reference.multiple_precision.nodes import (
    ExternalSeries,
    Held,
    Negative,
    Node,
    Pointwise,
    Power,
    Product,
    Quotient,
    Sum,
)
from hybridsim.reference.multiple_precision.precision import Number, Precision
from hybridsim.reference.multiple_precision.signals import Signal

_SMOOTH = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "sqrt")


class Reading:
    """The quantities of a model in the modes `z`, as nodes; equal expressions share a node.

    Parameters
    ----------
    modes : name of the mode of each component, in the order of ``model.all_components()``.
    signals : the inputs, in the order of their declaration.
    """

    def __init__(
        self, model: Model, modes: Sequence[str], precision: Precision, signals: Sequence[Signal]
    ) -> None:
        self.model, self.precision = model, precision
        self.modes = tuple(modes)
        self.context = precision.context
        self.functions = Functions(self.context)
        self.time = ExternalSeries(self.context)
        self.states = {state.name: ExternalSeries(self.context) for state in model.states}
        self.discrete = {part.name: Held(self.context, 0) for part in model.discrete}
        self.unknowns: dict[str, ExternalSeries] = {}
        self.surfaces: dict[str, Node] = {}
        self.input_coefficients: list[list[Held]] = []
        self._shared: dict[Any, Node] = {}
        self._names: dict[str, Node] = {TIME: self.time, **self.states, **self.discrete}
        self._texts: dict[str, Expression] = dict(model.definitions)
        self._open: list[str] = []
        for name, value in {**CONSTANTS, **model.parameter_values()}.items():
            self._names[name] = Held(self.context, value)
        self._rates = {state.name: state.der for state in model.states}
        components = list(zip(model.all_components(), modes, strict=True))
        for component, mode_name in components:
            mode, surface = component.mode(mode_name), component.surface
            self._rates.update(mode.der)
            self._texts.update(mode.set)
            if surface and surface.hold == mode_name:
                self._names[surface.unknown] = self.unknowns[component.name] = ExternalSeries(self.context)
        for signal in signals:
            self.input_coefficients.append([Held(self.context, 0) for _ in range(5)])
            self._names[signal.name] = self._signal(signal, self.input_coefficients[-1])
        for component, _ in components:
            if component.surface:
                self.surfaces[component.name] = self.node(component.surface.function)
        self.rates = [self.node(self._rates[state.name]) for state in model.states]
        self.guards = [
            [self.node(guard.expr) for guard in component.mode(mode).guards] for component, mode in components
        ]
        self.monitors = [self.node(monitor.expr) for monitor in model.monitors]

    def node(self, expr: Expression) -> Node:
        """Return the node of an expression."""
        return self._walk(expr.tree)

    def _signal(self, signal: Signal, piece: Sequence[Held]) -> Node:
        """Return the node of an input from the start and the four coefficients of its present cubic polynomial."""
        knot, *coefficients = piece
        passed = self.sum(self.time, knot, minus=True)
        total: Node = coefficients[3]
        for lower in (2, 1, 0):
            total = self.sum(coefficients[lower], self.product(passed, total))
        if not signal.angular:
            return total
        wave = self.product(
            Held(self.context, signal.values["amplitude"]), self.functions.build("sin", total)
        )
        return self.sum(Held(self.context, signal.values.get("offset", 0)), wave)

    def product(self, a: Node, b: Node) -> Node:
        """Return the product a*b as a shared node."""
        return self._share(("*", id(a), id(b)), lambda: Product(self.context, (a, b)))

    def sum(self, a: Node, b: Node, minus: bool = False) -> Node:
        """Return the sum a + b or the difference a - b as a shared node."""
        return self._share(("-" if minus else "+", id(a), id(b)), lambda: Sum(self.context, a, b, minus))

    def _share(self, key: Any, make: Callable[[], Node]) -> Node:
        if key not in self._shared:
            self._shared[key] = make()
        return self._shared[key]

    def _name(self, name: str) -> Node:
        if name not in self._names:
            if name in self._open:
                circle = " -> ".join([*self._open[self._open.index(name) :], name])
                raise UsageError(
                    f"circular definition of quantities: {circle}",
                    remedy="remove one dependency of this circle",
                )
            self._open.append(name)
            self._names[name] = self.node(self._texts[name])
            self._open.pop()
        return self._names[name]

    def _walk(self, tree: ast.expr) -> Node:
        match tree:
            case ast.Constant(value=bool() | int() | float() as value):
                number = value if isinstance(value, bool) else float(value)
                return self._share(("number", number), lambda: Held(self.context, number))
            case ast.Name(id=name):
                return self._name(name)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                u = self._walk(operand)
                return self._share(("neg", id(u)), lambda: Negative(self.context, (u,)))
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self._walk(operand)
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                return self._power(self._walk(left), self._walk(right), tree)
            case ast.BinOp(left=left, op=op, right=right):
                a, b = self._walk(left), self._walk(right)
                if isinstance(op, ast.Mult):
                    return self.product(a, b)
                if isinstance(op, ast.Div):
                    return self._share(("/", id(a), id(b)), lambda: Quotient(self.context, (a, b)))
                return self.sum(a, b, isinstance(op, ast.Sub))
            case ast.Call(func=ast.Name(id=name), args=[argument]) if name in _SMOOTH:
                u = self._walk(argument)
                return self._share((name, id(u)), lambda: self.functions.build(name, u))
        return self._pointwise(tree)

    def _power(self, base: Node, exponent: Node, tree: ast.expr) -> Node:
        """Return a power: a product for an integer exponent, otherwise a power of a positive base."""
        if not isinstance(exponent, Held):
            if exponent.constant and base.constant:
                return self._share(
                    ("**", id(base), id(exponent)),
                    lambda: Pointwise(self.context, (base, exponent), lambda a, b: a**b, ast.unparse(tree)),
                )
            logarithm = self._share(("log", id(base)), lambda: self.functions.build("log", base))
            return self.functions.build("exp", self.product(exponent, logarithm))
        value = exponent.value
        if value != int(value) or abs(value) > MAX_POWER:
            return self._share(("**", id(base), value), lambda: Power(self.context, base, value))
        result = self._whole_power(base, abs(int(value)))
        if value >= 0:
            return result
        one = self.functions.one
        return self._share(("/", id(one), id(result)), lambda: Quotient(self.context, (one, result)))

    def _whole_power(self, base: Node, n: int) -> Node:
        if n == 0:
            return self.functions.one
        if n == 1:
            return base
        half = self._whole_power(base, n // 2)
        square = self.product(half, half)
        return self.product(square, base) if n % 2 else square

    # -- quantities with a value but without a series
    # ----------------------------------------------------------

    def _pointwise(self, tree: ast.expr) -> Node:
        operands, function = self._parts(tree)
        return Pointwise(self.context, operands, function, ast.unparse(tree))

    def _parts(self, tree: ast.expr) -> tuple[list[Node], Callable[..., Any]]:
        match tree:
            case ast.UnaryOp(operand=operand):
                return [self._walk(operand)], lambda a: not a
            case ast.BoolOp(op=op, values=values):
                every = isinstance(op, ast.And)
                return [self._walk(v) for v in values], lambda *v: all(v) if every else any(v)
            case ast.Compare(left=left, ops=ops, comparators=others):
                kinds = [type(op) for op in ops]
                nodes = [self._walk(part) for part in (left, *others)]
                return nodes, lambda *v: all(
                    self.compare(kind, a, b) for kind, a, b in zip(kinds, v[:-1], v[1:], strict=True)
                )
            case ast.IfExp(test=test, body=body, orelse=orelse):
                nodes = [self._walk(part) for part in (test, body, orelse)]
                return nodes, lambda chosen, a, b: a if chosen else b
            case ast.Call(func=ast.Name(id=name), args=args):
                return [self._walk(argument) for argument in args], self._corners()[name]
        raise TypeError(f"a checked expression cannot contain {ast.dump(tree)}")

    def _corners(self) -> Mapping[str, Callable[..., Number]]:
        sign = self.context.sign
        return {"abs": abs, "sign": sign, "min": min, "max": max, "atan2": self.context.atan2}

    def compare(self, kind: type[ast.cmpop], a: Number, b: Number) -> bool:
        """Return the result of a comparison; numbers that agree to rounding are equal."""
        difference = a - b
        if abs(difference) <= self.precision.zero * (abs(a) + abs(b)):
            return kind in (ast.LtE, ast.GtE, ast.Eq)
        if kind in (ast.Eq, ast.NotEq):
            return kind is ast.NotEq
        return bool(difference < 0) == (kind in (ast.Lt, ast.LtE))
