"""Expressions and abstract models: what a random model means, before it is written down in any syntax."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any


@dataclass(frozen=True)
class Node:
    """An expression: an operation and its arguments."""

    op: str
    args: tuple[Any, ...] = ()

    def __add__(self, other: Any) -> Node:
        other = node(other)
        if self == ZERO:
            return other
        return self if other == ZERO else Node("add", (self, other))

    def __radd__(self, other: Any) -> Node:
        return node(other) + self

    def __sub__(self, other: Any) -> Node:
        other = node(other)
        return self if other == ZERO else Node("sub", (self, other))

    def __rsub__(self, other: Any) -> Node:
        return node(other) - self

    def __mul__(self, other: Any) -> Node:
        other = node(other)
        if ZERO in (self, other):
            return ZERO
        if self == ONE:
            return other
        return self if other == ONE else Node("mul", (self, other))

    def __rmul__(self, other: Any) -> Node:
        return node(other) * self

    def __truediv__(self, other: Any) -> Node:
        other = node(other)
        return ZERO if self == ZERO else Node("div", (self, other))

    def __neg__(self) -> Node:
        return ZERO if self == ZERO else Node("neg", (self,))


def node(value: Any) -> Node:
    """An expression as it is, or a constant that is part of the form and no number of the model."""
    return value if isinstance(value, Node) else Node("const", (Fraction(value),))


ZERO, ONE = Node("const", (Fraction(0),)), Node("const", (Fraction(1),))
TIME = Node("t")


def var(name: str) -> Node:
    """A state, a discrete state, a force or an input."""
    return Node("var", (name,))


def abs_(e: Node) -> Node:
    return Node("abs", (e,))


def max_(a: Any, b: Any) -> Node:
    return Node("max", (node(a), node(b)))


def min_(a: Any, b: Any) -> Node:
    return Node("min", (node(a), node(b)))


def cond(test: Node, a: Any, b: Any) -> Node:
    """``a`` where ``test`` > 0, else ``b``; the two agree where ``test`` is zero."""
    return Node("if", (test, node(a), node(b)))


def window(test: tuple[Any, ...], a: Any, b: Any) -> Node:
    """``a`` while a condition on time alone holds, else ``b``.

    The condition is ("after", e), ("before", e), ("near", e, width), or ("and" | "or", c, c), ("not", c).
    """
    return Node("window", (test, node(a), node(b)))


def sin(e: Node) -> Node:
    return Node("sin", (e,))


def cos(e: Node) -> Node:
    return Node("cos", (e,))


def sqrt(e: Node) -> Node:
    return Node("sqrt", (e,))


def lowered(e: Node) -> Node:
    """The same with each corner as one conditional."""
    args = tuple(lowered(a) if isinstance(a, Node) else a for a in e.args)
    if e.op == "abs":
        return Node("if", (args[0], args[0], -args[0]))
    if e.op == "max":
        return Node("if", (args[0] - args[1], args[0], args[1]))
    if e.op == "min":
        return Node("if", (args[0] - args[1], args[1], args[0]))
    return Node(e.op, args)


def rate_of(e: Node, rates: dict[str, Node]) -> Node:
    """The derivative in time of a lowered expression along given rates of the states."""
    a = e.args
    if e.op in ("num", "const", "slope"):
        return ZERO
    if e.op == "t":
        return ONE
    if e.op == "var":
        return rates.get(a[0], ZERO)
    if e.op == "table":
        return Node("slope", a)
    if e.op in ("if", "window"):
        return Node(e.op, (a[0], rate_of(a[1], rates), rate_of(a[2], rates)))
    first = rate_of(a[0], rates)
    if e.op == "neg":
        return -first
    if e.op == "sin":
        return cos(a[0]) * first
    if e.op == "cos":
        return -(sin(a[0]) * first)
    if e.op == "sqrt":
        return first / (node(2) * e)
    second = rate_of(a[1], rates)
    if e.op == "add":
        return first + second
    if e.op == "sub":
        return first - second
    if e.op == "mul":
        return first * a[1] + a[0] * second
    if e.op == "div":
        return (first - e * second) / a[1]
    raise ValueError(e.op)


def replaced(e: Node, names: dict[str, Node]) -> Node:
    """The same with expressions in the place of variables."""
    if e.op == "var":
        return names.get(e.args[0], e)
    return Node(e.op, tuple(replaced(a, names) if isinstance(a, Node) else a for a in e.args))


def parts_of(e: Any) -> list[Node]:
    """All nodes of an expression, conditions on time included."""
    if isinstance(e, tuple):
        return [p for a in e for p in parts_of(a)]
    if not isinstance(e, Node):
        return []
    return [e] + [p for a in e.args for p in parts_of(a)]


def constant(e: Node, numbers: dict[str, Fraction]) -> Fraction:
    """The value of an expression of numbers alone."""
    if e.op == "const":
        return e.args[0]
    if e.op == "num":
        return numbers[e.args[0]]
    a = [constant(x, numbers) for x in e.args]
    if e.op == "neg":
        return -a[0]
    if e.op == "div":
        return a[0] / a[1]
    return a[0] + a[1] if e.op == "add" else a[0] - a[1] if e.op == "sub" else a[0] * a[1]


# -- models ------------------------------------------------------------------------------------------------------


@dataclass
class Number:
    """A number of the model: how its values are drawn, and the syntax it is written in."""

    low: Fraction
    high: Fraction
    steps: int
    written: str = "parameter"
    value: Fraction | None = None  # a value of all draws
    formula: Node | None = None  # of other numbers, which it is to meet exactly


@dataclass
class Contact:
    velocity: Node
    normal: Node
    mu_s: Node
    mu_k: Node | None = None  # as mu_s
    opens: bool = False


@dataclass
class Impact:
    gap: Node
    restitution: Node


@dataclass
class Choice:
    to: str
    when: Node | None = None  # holds where > 0
    reset: dict[str, Node] = field(default_factory=dict)
    adds: dict[str, Node] = field(default_factory=dict)


@dataclass
class Guard:
    expr: Node
    choices: list[Choice]


@dataclass
class Mode:
    guards: dict[str, Guard] = field(default_factory=dict)
    rates: dict[str, Node] = field(default_factory=dict)
    sets: dict[str, Node] = field(default_factory=dict)


@dataclass
class Automaton:
    modes: dict[str, Mode]
    initial: str


@dataclass
class Monitor:
    expr: Node
    direction: str = "both"
    action: str = "record"
    reset: dict[str, Node] = field(default_factory=dict)


@dataclass
class Schedule:
    """Resets at known times; with a period it is a clock from its first time on."""

    times: list[Node]
    reset: dict[str, Node] = field(default_factory=dict)
    adds: dict[str, Node] = field(default_factory=dict)
    period: Node | None = None


@dataclass
class Abstract:
    """A model as the judge knows it."""

    duration: float = 5.0
    numbers: dict[str, Number] = field(default_factory=dict)
    states: dict[str, tuple[Node, Node]] = field(default_factory=dict)  # start, rate
    discrete: dict[str, Node] = field(default_factory=dict)
    contacts: dict[str, Contact] = field(default_factory=dict)
    impacts: dict[str, Impact] = field(default_factory=dict)
    relays: dict[str, Node] = field(default_factory=dict)
    automata: dict[str, Automaton] = field(default_factory=dict)
    monitors: dict[str, Monitor] = field(default_factory=dict)
    schedules: dict[str, Schedule] = field(default_factory=dict)
    tables: dict[str, tuple[list[Node], list[Node]]] = field(default_factory=dict)
    waves: dict[str, tuple[str, Fraction, Fraction]] = field(default_factory=dict)  # tables written as waves
    features: set[str] = field(default_factory=set)
