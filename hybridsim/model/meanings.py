"""This module resolves the names in a model: definitions, varying quantities, and forces."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping

from hybridsim.expr.grammar import TIME
from hybridsim.expr.polynomial import Polynomial, constant_of, direction, polynomial
from hybridsim.expr.rebuild import rebuilt, with_names
from hybridsim.model.parts.component import Component, Mode
from hybridsim.model.parts.model import Model
from hybridsim.model.smoothing.one_sided import names_of

Family = frozenset[object]
"""A key that an expression shares with all its nonzero multiples."""
_MOST_PARTS = 2_000  # largest tree with inserted definitions; larger ones are compared as written


class Meanings:
    """The definitions of one model, and the names that vary or depend on forces."""

    def __init__(self, model: Model) -> None:
        trees = {name: expr.tree for name, expr in model.definitions}
        components = model.all_components()
        self.unknowns = {c.surface.unknown for c in components if c.surface}
        behind = {name: [tree] for name, tree in trees.items()}
        for component in components:
            for mode in component.modes:
                for name, expr in mode.set.items():
                    behind.setdefault(name, []).append(expr.tree)
        sources = {TIME, *(state.name for state in model.states), *(signal.name for signal in model.inputs)}
        self.moving = _reaching(behind, sources | self.unknowns)
        self.forced = _reaching(behind, self.unknowns)
        self.definitions = {name: self.with_single_signs(tree) for name, tree in trees.items()}

    def with_single_signs(self, node: ast.expr) -> ast.expr:
        """Return a tree in which the sign of a product is a product of signs."""
        if not any(isinstance(part, ast.Name) and part.id == "sign" for part in ast.walk(node)):
            return node
        match rebuilt(node, self.with_single_signs):
            case ast.Call(
                func=ast.Name(id="sign") as sign,
                args=[ast.BinOp(left=left, op=ast.Mult() | ast.Div(), right=right)],
            ) if self.moves(left) and self.moves(right):
                parts = [self.with_single_signs(ast.Call(sign, [part], [])) for part in (left, right)]
                return ast.BinOp(parts[0], ast.Mult(), parts[1])
            case made:
                return made

    def lookup(self, name: str) -> ast.expr | None:
        """Return the tree of a definition with a given name, or None."""
        return self.definitions.get(name)

    def moves(self, node: ast.expr) -> bool:
        """Return whether the value of a syntax tree can change while all modes stay active."""
        return not names_of(node).isdisjoint(self.moving)

    def reached(self, trees: Iterable[ast.expr]) -> set[str]:
        """Return the definitions on which some syntax trees depend."""
        open_ = {name for tree in trees for name in names_of(tree)} & self.definitions.keys()
        found: set[str] = set()
        while open_:
            name = open_.pop()
            found.add(name)
            open_ |= (names_of(self.definitions[name]) & self.definitions.keys()) - found
        return found

    def depended_on(self, names: Iterable[str]) -> set[str]:
        """Return the given names, and all names on which their definitions depend."""
        trees: list[ast.expr] = [ast.Name(name, ast.Load()) for name in names]
        return set().union(
            *map(names_of, trees), *(names_of(self.definitions[name]) for name in self.reached(trees))
        )

    def written_out(self, node: ast.expr) -> ast.expr:
        """Return a tree with its definitions inserted, or the tree itself if the result is too large."""
        inner = node
        while names_of(inner) & self.definitions.keys():
            inner = with_names(inner, self.definitions)
            if sum(1 for _ in ast.walk(inner)) > _MOST_PARTS:
                return node
        return inner

    def family(self, node: ast.expr) -> tuple[Family, int]:
        """Return a key that all multiples of an expression share, and the sign of the expression relative to it."""
        p: Polynomial = polynomial(self.written_out(node))
        number = constant_of(p)
        if number is not None:
            return frozenset(), (number > 0) - (number < 0)
        found, sign = direction(p)
        return frozenset(found), sign

    def signs(self, component: Component, mode: Mode) -> Mapping[Family, int]:
        """Return the signs that are known in a mode: the signs of its guards, and 0 for a held surface."""
        surface = component.surface
        known: dict[Family, int] = {}
        for guard in mode.guards:
            found, sign = self.family(guard.expr.tree)
            if found:
                known[found] = sign
        if surface and mode.name == surface.hold:
            known[self.family(surface.function.tree)[0]] = 0
        return known


def _reaching(behind: Mapping[str, Iterable[ast.expr]], sources: set[str]) -> set[str]:
    """Return the given names and all names that depend on any of them."""
    found, size = set(sources), -1
    while len(found) > size:
        size = len(found)
        found |= {name for name, trees in behind.items() if any(names_of(tree) & found for tree in trees)}
    return found
