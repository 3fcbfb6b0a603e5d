"""This module finds denominators of rates that may become zero; an integration step can miss such a zero."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from hybridsim.expr.grammar import TIME
from hybridsim.expr.walk import NoValue, value_of
from hybridsim.model.meanings import Meanings
from hybridsim.model.parts.model import Model
from hybridsim.model.smoothing.one_sided import names_of, never_negative


@dataclass(frozen=True)
class Denominator:
    """A denominator in a rate, with the definitions that it uses.

    Parameters
    ----------
    tree : the denominator.
    definitions : trees of the definitions that it uses, in order of dependency.
    state : the state whose rate contains it.
    """

    tree: ast.expr
    definitions: Mapping[str, ast.expr]
    state: str

    @property
    def text(self) -> str:
        """The text of the denominator as written in the model."""
        return ast.unparse(self.tree)

    def sign(self, values: Mapping[str, float]) -> int:
        """Return the sign of the denominator at a state and time, or 0 if the denominator is zero or undefined."""
        known = dict(values)
        try:
            for name, tree in self.definitions.items():
                known[name] = value_of(tree, known)
            value = value_of(self.tree, known)
        except NoValue:
            return 0
        return (value > 0.0) - (value < 0.0)


def denominators(model: Model) -> tuple[Denominator, ...]:
    """Return those denominators in rates that may change their sign, and contain only states, parameters and t.

    Denominators inside a condition are omitted, because the condition may exclude the zero. Denominators that are never
    negative by their form are omitted too.
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
                meanings_used = _in_order(node, meanings)
                free = (
                    names_of(node).union(*(names_of(t) for t in meanings_used.values()))
                    - meanings_used.keys()
                )
                if free <= known and not free.isdisjoint(known - {p.name for p in model.parameters}):
                    yield Denominator(node, meanings_used, state.name)


def _divisors(node: ast.expr) -> Iterator[ast.expr]:
    """Yield divisors and bases of negative powers in an expression, except inside conditions."""
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
    """Return the definitions that an expression uses, sorted by their dependencies."""
    found: dict[str, ast.expr] = {}

    def visit(tree: ast.expr) -> None:
        for name in sorted(names_of(tree)):
            behind = meanings.lookup(name)
            if behind is not None and name not in found:
                visit(behind)
                found[name] = behind

    visit(node)
    return found
