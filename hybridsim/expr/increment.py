"""Increments of variables by resets, written '+= expression'."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass

from hybridsim.errors import ExpressionError, Place
from hybridsim.expr.parse import Expression, parse, substitute

ADDS = "+="  # prefix of the text of an increment
HEAD = ADDS + " "


@dataclass(frozen=True)
class Increment(Expression):
    """The amount that a reset adds to a variable, as an expression; its text starts with '+= '."""

    def error(
        self, message: str, *, node: ast.expr | None = None, remedy: str | None = None
    ) -> ExpressionError:
        """Return an error that points at this amount, or at a node of its tree."""
        column = None if node is None else getattr(node, "col_offset", None)
        place = (self.place or Place()).at(self.text, None if column is None else column + len(HEAD))
        return ExpressionError(message, place=place, remedy=remedy)


def parse_reset(value: str | float | bool | Expression, place: Place | None = None) -> Expression:
    """Parse a reset: a new value of a variable, or an amount to add, '+= expression'."""
    if isinstance(value, str) and value.lstrip().startswith(ADDS):
        return _increment(parse(value.lstrip().removeprefix(ADDS), place))
    return parse(value, place)


def substitute_in_reset(expr: Expression, values: Mapping[str, Expression]) -> Expression:
    """Substitute expressions for names; an increment remains an increment."""
    found = substitute(expr, values)
    return _increment(found) if isinstance(expr, Increment) and found is not expr else found


def assignment(name: str, expr: Expression, sign: str = "=") -> str:
    """Return the text of a reset: 'name = expression' or 'name += expression'."""
    return f"{name} {expr.text}" if isinstance(expr, Increment) else f"{name} {sign} {expr.text}"


def _increment(amount: Expression) -> Increment:
    return Increment(HEAD + amount.text, amount.names, amount.place, amount.tree)
