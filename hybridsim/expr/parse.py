"""Text to a checked expression tree: a whitelist over Python's syntax, never `eval`."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from numbers import Integral, Real
from typing import SupportsFloat

from hybridsim.errors import ExpressionError, Place, nearest
from hybridsim.expr.check import check_size, check_tree
from hybridsim.expr.grammar import (
    CONSTANTS,
    FUNCTIONS,
    MAX_DEPTH,
    MAX_DERIVED_DEPTH,
    MAX_DERIVED_NODES,
    MAX_INTEGER,
    MAX_LENGTH,
)
from hybridsim.expr.python_tree import python_tree
from hybridsim.expr.rebuild import with_names
from hybridsim.expr.write import write

_NUMBER = r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"
# a number and a word behind it
_WITH_UNIT, _JOINED = re.compile(_NUMBER + r"\s+[A-Za-z]"), re.compile(_NUMBER + "[A-Za-z]")
_WITHOUT_UNIT = "write the number alone: a unit stands in the field 'unit', and nothing is converted."
_PRODUCT = "write the number alone, its unit in the field 'unit', or a product with '*', e.g. '2*x'."
_AS_IN_PYTHON = "write it as in Python, e.g. 'a*sin(omega*t) - c*v'."
_ALLOWED = re.compile(r"[A-Za-z0-9_ +\-*/().,<>=!]")
_ADVICE = {
    "^": "write a power as **.",
    "&": "write 'and'.",
    "|": "write 'or'.",
    "~": "write 'not'.",
    "%": "the remainder is not available; a periodic signal is an input of kind 'wave'.",
    "[": "there are no lists or subscripts in expressions.",
    "{": "there are no sets or tables in expressions.",
    ":": "there are no slices, lambdas or assignments in expressions.",
    ";": "an expression is a single one.",
    "#": "comments belong outside the expression.",
    "'": "there are no texts in expressions.",
    '"': "there are no texts in expressions.",
}


@dataclass(frozen=True)
class Expression:
    """A checked expression; two are equal when their texts are.

    Parameters
    ----------
    text : as written, on one line.
    names : the names it depends on (``t`` included, functions and ``pi`` not).
    place : where it was written; the caret of an error is set within ``text``.
    tree : the checked syntax tree. Only node kinds that `hybridsim.expr.check` lets through occur in it.
    """

    text: str
    names: frozenset[str] = field(compare=False, repr=False)
    place: Place | None = field(compare=False, repr=False)
    tree: ast.expr = field(compare=False, repr=False)

    @property
    def is_boolean(self) -> bool:
        """Whether the value is true or false (a comparison, and, or, not) instead of a number."""
        node = self.tree
        while isinstance(node, ast.IfExp):
            node = node.body
        if isinstance(node, ast.UnaryOp):
            return isinstance(node.op, ast.Not)
        return isinstance(node, (ast.Compare, ast.BoolOp)) or (
            isinstance(node, ast.Constant) and isinstance(node.value, bool)
        )

    @property
    def is_constant(self) -> bool:
        """Whether it depends on no name at all."""
        return not self.names

    def error(
        self, message: str, *, node: ast.expr | None = None, remedy: str | None = None
    ) -> ExpressionError:
        """An error that points at this expression, or at a node of it."""
        column = None if node is None else getattr(node, "col_offset", None)
        place = (self.place or Place()).at(self.text, column)
        return ExpressionError(message, place=place, remedy=remedy)

    def __str__(self) -> str:
        return self.text


def parse(text: str | float | bool | Expression, place: Place | None = None) -> Expression:
    """Check a text against the whitelist and keep its tree.

    Parameters
    ----------
    text : an expression, or a number as TOML and Python give it.
    place : file and line for messages.

    Raises
    ------
    ExpressionError
        With a caret: a character, construct, function or number that is not allowed, wrong arity,
        too long, too deep, a power out of bounds, or a constant part without a finite real value.
    """
    if isinstance(text, Expression):
        return text
    if isinstance(text, float) and math.isfinite(text):
        return _of_number(float(text), place)
    where = place or Place()
    text = _as_text(text, where)
    text = re.sub(r"[ \t\r\n]", " ", text).strip()
    _check_text(text, where)
    try:
        tree = python_tree(text, "eval").body
        check_size(tree, text, where, MAX_DEPTH, MAX_LENGTH)
        names = check_tree(tree, text, where)
    except (SyntaxError, ValueError) as fault:
        column = getattr(fault, "offset", None)
        column = None if column is None else min(max(column - 1, 0), len(text))
        reason = getattr(fault, "msg", None) or str(fault)
        raise ExpressionError(
            f"not an expression: {reason}",
            place=where.at(text, column),
            remedy=_WITHOUT_UNIT
            if _WITH_UNIT.match(text)
            else _PRODUCT
            if _JOINED.match(text)
            else _AS_IN_PYTHON,
        ) from None
    except (RecursionError, MemoryError):
        raise ExpressionError(
            "the expression is nested too deeply",
            place=where.at(text),
            remedy="name parts of it in [definitions].",
        ) from None
    return Expression(text, names, place, tree)


def _of_number(number: float, place: Place | None) -> Expression:
    """The expression that the text of a number gives, without the way through the text."""
    tree: ast.expr = ast.Constant(abs(number))
    if math.copysign(1.0, number) < 0.0:
        tree = ast.UnaryOp(ast.USub(), tree)
    return Expression(repr(number), frozenset(), place, tree)


def require_names(expr: Expression, known: Iterable[str]) -> None:
    """See to it that every name of an expression is known; else an error with the nearest ones."""
    unknown = expr.names.difference(known)
    if not unknown:
        return
    allowed = set(known)
    nodes = [n for n in ast.walk(expr.tree) if isinstance(n, ast.Name) and n.id in unknown]
    node = min(nodes, key=lambda n: n.col_offset)
    if node.id.lower() in ("nan", "inf", "infinity"):
        raise expr.error(f"'{node.id}' is not finite", node=node, remedy="give a finite number.")
    remedy = nearest(node.id, allowed | set(FUNCTIONS) | set(CONSTANTS))
    if "did you mean" not in remedy:
        remedy = nearest(node.id, allowed)
    raise expr.error(f"unknown name '{node.id}'", node=node, remedy=remedy)


def substitute(expr: Expression, values: Mapping[str, Expression | str | float]) -> Expression:
    """Put expressions in the place of names, all at once, in the tree (no parentheses can be lost).

    The result is checked like a text (its bounds are wider, since it was derived and not typed) and keeps the
    place of ``expr``.
    """
    parts = {name: parse(value).tree for name, value in values.items() if name in expr.names}
    if not parts:
        return expr
    where = expr.place or Place()
    try:
        tree = with_names(expr.tree, parts)
        check_size(tree, expr.text, where, MAX_DERIVED_DEPTH, MAX_DERIVED_NODES)
        text = write(tree)
        names = check_tree(tree, text, where, columns=False)
    except RecursionError:
        raise expr.error(
            f"'{_short(expr.text)}' is nested too deeply once its names are put in", remedy="simplify it."
        ) from None
    return Expression(text, names, expr.place, tree)


def of_tree(tree: ast.expr, place: Place | None = None) -> Expression:
    """A tree of checked parts as an expression; names may be the program's own, which begin with two underscores."""
    words = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    return Expression(write(tree), frozenset(words - CONSTANTS.keys() - FUNCTIONS.keys()), place, tree)


def _check_text(text: str, where: Place) -> None:
    """What can be refused before Python's parser is asked: emptiness, length, characters."""
    if not text:
        raise ExpressionError(
            "the expression is empty", place=where, remedy="write a number or an expression."
        )
    if len(text) > MAX_LENGTH:
        raise ExpressionError(
            f"the expression has {len(text)} characters, {MAX_LENGTH} are allowed",
            place=where.at(_short(text)),
            remedy="name parts of it in [definitions].",
        )
    for column, character in enumerate(text):
        if not _ALLOWED.match(character):
            shown = character if character.isprintable() else f"U+{ord(character):04X}"
            printable = "".join(c if c.isprintable() else "?" for c in text)
            advice = _ADVICE.get(
                character, "names are ASCII letters, digits and _ (Greek is spelled: omega)."
            )
            raise ExpressionError(
                f"the character '{shown}' is not allowed in an expression",
                place=where.at(printable, column),
                remedy=advice,
            )


def _as_text(given: object, where: Place) -> str:
    """Numbers as Python writes them; whatever is neither number nor text is refused."""
    if isinstance(given, str):
        return given
    if isinstance(given, bool):
        return str(given)
    if isinstance(given, Integral):
        value = int(given)
        return str(value) if abs(value) <= MAX_INTEGER else repr(_double(value, where))
    if isinstance(given, Real):
        number = _double(given, where)
        if not math.isfinite(number):
            raise ExpressionError(f"{number} is not finite", place=where, remedy="give a finite number.")
        return repr(number)
    raise ExpressionError(
        f"{_short(repr(given))} is no expression",
        place=where,
        remedy='write a number, or an expression in quotes such as "sqrt(k/m)".',
    )


def _double(value: SupportsFloat, where: Place) -> float:
    try:
        return float(value)
    except OverflowError:
        raise ExpressionError(
            "the number is too large for a double", place=where, remedy="give a number below 1.8e308."
        ) from None


def _short(text: str, most: int = 60) -> str:
    return text if len(text) <= most else text[: most - 3] + "..."
