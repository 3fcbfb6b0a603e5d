"""Random conditions, and integrals of what they choose: thresholds are sorted, Python evaluates between them."""

from __future__ import annotations

import ast
import random
from dataclasses import dataclass, field
from itertools import pairwise

END = 10.0


@dataclass
class Conditions:
    """Makes expressions over t and over states that grow linearly; remembers every instant at which they may change."""

    chance: random.Random
    starts: dict[str, float]  # of the states, which all have the rate 1
    parameters: dict[str, float] = field(default_factory=dict)
    definitions: dict[str, str] = field(default_factory=dict)
    instants: set[float] = field(default_factory=set)
    negated: bool = False  # write every conditional the other way round

    def expression(self, depth: int) -> str:
        """A number, or a conditional between such."""
        if depth == 0:
            return self.number(self.chance.randint(-5, 5))
        first, second = self.expression(depth - 1), self.expression(self.chance.randint(0, depth - 1))
        condition = self.condition(self.chance.randint(0, 2))
        if self.negated:
            return f"({second} if not ({condition}) else {first})"
        return f"({first} if {condition} else {second})"

    def condition(self, depth: int) -> str:
        """A comparison, or a combination of such."""
        kind = (
            self.chance.choice(["and", "or", "not", "chain", "abs", "far", "max", "one"]) if depth else "one"
        )
        if kind in ("and", "or"):
            return f"({self.condition(depth - 1)} {kind} {self.condition(depth - 1)})"
        if kind == "not":
            return f"(not {self.condition(depth - 1)})"
        name, low, high = (
            self.chance.choice(["t", *self.starts]),
            *sorted(self.chance.sample(range(1, 200), 2)),
        )
        a, b = (0.05 * k + self.starts.get(name, 0.0) for k in (low, high))
        if kind == "one":
            self.at(name, a)
            return self.chance.choice(
                [
                    f"{name} > {self.number(a)}",
                    f"{self.number(a)} >= {name}",
                    f"2*{name} - {self.number(a)} < {self.number(a)}",
                ]
            )
        self.at(name, a, b)
        if kind == "chain":
            return f"({self.number(a)} < {name} <= {self.number(b)})"
        if kind == "max":
            return f"max({name} - {self.number(b)}, {self.number(a)} - {name}) > 0"
        self.at(name, (a + b) / 2)
        middle, half = self.number((a + b) / 2), self.number((b - a) / 2)
        return f"abs({name} - {middle}) {'<' if kind == 'abs' else '>'} {half}"

    def at(self, name: str, *values: float) -> None:
        """Note when a quantity has these values."""
        self.instants.update(value - self.starts.get(name, 0.0) for value in values)

    def number(self, value: float) -> str:
        """A number as it is, as a parameter, or as a definition over one."""
        kind = self.chance.choice(["plain", "plain", "parameter", "definition"])
        if kind == "plain":
            return f"({value!r})"
        name = f"q{len(self.parameters)}"
        self.parameters[name] = value
        if kind == "parameter":
            return name
        self.definitions[f"d{name}"] = f"{name} + 0"
        return f"d{name}"

    def integral(self, text: str) -> float:
        """Of the expression from 0 to the end."""
        knots = sorted({0.0, END, *(t for t in self.instants if 0.0 < t < END)})
        return sum((b - a) * self.value(text, (a + b) / 2) for a, b in pairwise(knots))

    def value(self, text: str, t: float) -> float:
        """Of the expression at one instant."""
        names = {**self.parameters, "t": t, **{name: start + t for name, start in self.starts.items()}}
        names |= {name: self.parameters[name[1:]] for name in self.definitions}
        return _value(ast.parse(text, mode="eval").body, names)


def _value(node: ast.expr, names: dict[str, float]) -> float:
    """Of a tree, by a walk of its own."""
    match node:
        case ast.Constant(value=value):
            return value
        case ast.Name(id=name):
            return names[name]
        case ast.UnaryOp(op=op, operand=operand):
            return not _value(operand, names) if isinstance(op, ast.Not) else -_value(operand, names)
        case ast.BinOp(left=left, op=op, right=right):
            a, b = _value(left, names), _value(right, names)
            return a - b if isinstance(op, ast.Sub) else a * b
        case ast.BoolOp(op=op, values=values):
            return (all if isinstance(op, ast.And) else any)(_value(value, names) for value in values)
        case ast.Compare(left=left, ops=ops, comparators=others):
            terms = [_value(part, names) for part in (left, *others)]
            holds = {ast.Lt: float.__lt__, ast.LtE: float.__le__, ast.Gt: float.__gt__, ast.GtE: float.__ge__}
            pairs = zip(ops, pairwise(terms), strict=True)
            return all(holds[type(op)](float(a), float(b)) for op, (a, b) in pairs)
        case ast.IfExp(test=test, body=body, orelse=orelse):
            return _value(body if _value(test, names) else orelse, names)
        case ast.Call(func=ast.Name(id=name), args=args):
            return {"abs": abs, "max": max}[name](*(_value(arg, names) for arg in args))
    raise TypeError(ast.dump(node))
