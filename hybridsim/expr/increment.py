"""An amount that a reset adds to a variable: the form '+= expression'."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass

from hybridsim.errors import ExpressionError, Place
from hybridsim.expr.parse import Expression, parse, substitute

ADDS = "+="  # what the text of an increment begins with
_HEAD = ADDS + " "


@dataclass(frozen=True)
class Increment(Expression):
    """The amount itself is ``names`` and ``tree``; the text has '+= ' before it, as it was written."""

    def error(
        self, message: str, *, node: ast.expr | None = None, remedy: str | None = None
    ) -> ExpressionError:
        """An error that points at this amount, or at a node of it."""
        column = None if node is None else getattr(node, "col_offset", None)
        place = (self.place or Place()).at(self.text, None if column is None else column + len(_HEAD))
        return ExpressionError(message, place=place, remedy=remedy)


def parse_reset(value: str | float | bool | Expression, place: Place | None = None) -> Expression:
    """The new value that a reset gives to a variable, or the amount that it adds: '+= expression'."""
    if isinstance(value, str) and value.lstrip().startswith(ADDS):
        return _increment(parse(value.lstrip().removeprefix(ADDS), place))
    return parse(value, place)


def substitute_in_reset(expr: Expression, values: Mapping[str, Expression]) -> Expression:
    """Put expressions in the place of names; an amount to add stays one."""
    found = substitute(expr, values)
    return _increment(found) if isinstance(expr, Increment) and found is not expr else found


def assignment(name: str, expr: Expression, sign: str = "=") -> str:
    """What a reset does to a variable, as text: 'name = expression' or 'name += expression'."""
    return f"{name} {expr.text}" if isinstance(expr, Increment) else f"{name} {sign} {expr.text}"


def _increment(amount: Expression) -> Increment:
    return Increment(_HEAD + amount.text, amount.names, amount.place, amount.tree)
