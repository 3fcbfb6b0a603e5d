"""Denominators of rates: where one passes zero, a rate has a pole, or is 0/0, and a run that goes on is wrong."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hybridsim.expr.grammar import TIME
from hybridsim.expr.walk import NoValue, value_of
from hybridsim.model.meanings import Meanings
from hybridsim.model.one_sided import names_of, never_negative

if TYPE_CHECKING:
    from hybridsim.model.model import Model


@dataclass(frozen=True)
class Denominator:
    """What a rate is divided by, with definitions as they stand.

    Parameters
    ----------
    tree : the expression.
    definitions : trees of the definitions that it needs, each after those that it depends on.
    state : whose rate it is in.
    """

    tree: ast.expr
    definitions: Mapping[str, ast.expr]
    state: str

    @property
    def text(self) -> str:
        """As it is written."""
        return ast.unparse(self.tree)

    def sign(self, values: Mapping[str, float]) -> int:
        """Its sign at given parameters, states and time; 0 where it is zero or has no value."""
        known = dict(values)
        try:
            for name, tree in self.definitions.items():
                known[name] = value_of(tree, known)
            value = value_of(self.tree, known)
        except NoValue:
            return 0
        return (value > 0.0) - (value < 0.0)


def denominators(model: Model) -> tuple[Denominator, ...]:
    """Denominators of the states' own rates that can pass zero, as far as states, parameters and t decide them.

    Left out are those inside of a condition, which may keep away from the zero, and those whose form shows that they
    are never negative.
    """
    found: tuple[Denominator, ...] = model.once("denominators", lambda: tuple(_denominators(model)))
    return found


def _denominators(model: Model) -> Iterator[Denominator]:
    meanings = Meanings(model)
    known = {TIME, *(p.name for p in model.parameters), *(s.name for s in model.states)}
    seen: set[str] = set()
    for state in model.states:
        reached = meanings.reached([state.der.tree])
        for tree in (state.der.tree, *(meanings.definitions[name] for name in sorted(reached))):
            for node in _divisors(tree):
                text = ast.dump(node)
                if text in seen or never_negative(node, {}, meanings.lookup) is not None:
                    continue
                seen.add(text)
                needed = _in_order(node, meanings)
                free = names_of(node).union(*(names_of(t) for t in needed.values())) - needed.keys()
                if free <= known and not free.isdisjoint(known - {p.name for p in model.parameters}):
                    yield Denominator(node, needed, state.name)


def _divisors(node: ast.expr) -> Iterator[ast.expr]:
    """Right sides of divisions and bases of negative powers, outside of conditions."""
    match node:
        case ast.IfExp():
            return
        case ast.BinOp(op=ast.Div(), right=divisor):
            yield divisor
        case ast.BinOp(left=base, op=ast.Pow(), right=ast.UnaryOp(op=ast.USub())):
            yield base
    for part in ast.iter_child_nodes(node):
        if isinstance(part, ast.expr):
            yield from _divisors(part)


def _in_order(node: ast.expr, meanings: Meanings) -> dict[str, ast.expr]:
    """The definitions behind an expression, each after those that it depends on."""
    found: dict[str, ast.expr] = {}

    def visit(tree: ast.expr) -> None:
        for name in sorted(names_of(tree)):
            behind = meanings.lookup(name)
            if behind is not None and name not in found:
                visit(behind)
                found[name] = behind

    visit(node)
    return found
