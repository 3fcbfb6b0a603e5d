"""Parse text to a checked expression tree, with a whitelist of Python's syntax and without `eval`."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from numbers import Integral, Real
from typing import Any, SupportsFloat

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
from hybridsim.expr.python_tree import python_tree, with_dotted_names
from hybridsim.expr.rebuild import with_names
from hybridsim.expr.write import write

_NUMBER = r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"
# a number followed by a word
_WITH_UNIT, _JOINED = re.compile(_NUMBER + r"\s+[A-Za-z]"), re.compile(_NUMBER + "[A-Za-z]")
_WITHOUT_UNIT = "write only the number; set the unit in the field 'unit' (units are not converted)"
_PRODUCT = (
    "write only the number and set the unit in the field 'unit', or write a product with '*', such as '2*x'"
)
_AS_IN_PYTHON = "use the syntax of Python, such as 'a*sin(omega*t) - c*v'"
_NO_NAMES: frozenset[str] = frozenset()
_ALLOWED = re.compile(r"[A-Za-z0-9_ +\-*/().,<>=!]")
_ADVICE = {
    "^": "write a power with **, such as x**2",
    "&": "write 'and' instead of '&'",
    "|": "write 'or' instead of '|'",
    "~": "write 'not' instead of '~'",
    "%": "write mod(x, d) for the remainder x - d*floor(x/d)",
    "[": "expressions cannot contain lists or subscripts; part 3 of the repeated part 'block' is block3",
    "{": "expressions cannot contain sets or tables",
    ":": "expressions cannot contain slices, lambdas or assignments",
    ";": "write a single expression",
    "#": "write comments outside the expression",
    "'": "expressions cannot contain strings",
    '"': "expressions cannot contain strings",
}


@dataclass(frozen=True)
class Expression:
    """An expression that was checked; two expressions are equal if their texts are equal.

    Parameters
    ----------
    text : source text on one line.
    names : the names that it depends on, including ``t``, without functions and ``pi``.
    place : place of the declaration; errors add a caret within ``text``.
    tree : the syntax tree, which contains only node types accepted by `hybridsim.expr.check`.
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
        """Whether the expression contains no names."""
        return not self.names

    @property
    def is_number(self) -> bool:
        """Whether the expression is a number: the value is not true or false, and the text contains no names."""
        return not self.names and not self.is_boolean

    def error(
        self, message: str, *, node: ast.expr | None = None, remedy: str | None = None
    ) -> ExpressionError:
        """Return an error that points at this expression, or at a node of its tree."""
        column = None if node is None else getattr(node, "col_offset", None)
        place = (self.place or Place()).at(self.text, column)
        return ExpressionError(message, place=place, remedy=remedy)

    def __str__(self) -> str:
        return self.text


def parse(text: str | float | bool | Expression, place: Place | None = None) -> Expression:
    """Parse a text, check it against the whitelist, and return the expression.

    Parameters
    ----------
    text : an expression as string, or a number.
    place : file and line for messages.

    Raises
    ------
    ExpressionError
        For a character, construct, function or number that is not allowed, a wrong number of arguments, an expression
        that is too long or too deep, an exponent that is too large, or a constant part without a finite real value.
        The error has a caret.
    """
    if isinstance(text, Expression):
        return text
    if isinstance(text, float) and math.isfinite(text):
        return _of_number(float(text), place)
    where = place or Place()
    text = one_line(_as_text(text, where))
    check_text(text, where)
    tree, names = checked_tree(text, where, with_dotted_names)
    return Expression(text, names, place, tree)


def one_line(text: str) -> str:
    """Return a text without line breaks and without blanks at its ends."""
    return re.sub(r"[ \t\r\n]", " ", text).strip()


def checked_tree(
    text: str, where: Place, prepare: Callable[[ast.expr], ast.expr]
) -> tuple[ast.expr, frozenset[str]]:
    """Parse a text, apply ``prepare`` to its tree, and check the tree; return the tree and its names."""
    try:
        tree = prepare(python_tree(text, "eval").body)
        check_size(tree, text, where, MAX_DEPTH, MAX_LENGTH)
        names = check_tree(tree, text, where)
    except (SyntaxError, ValueError) as fault:
        column = getattr(fault, "offset", None)
        column = None if column is None else min(max(column - 1, 0), len(text))
        reason = getattr(fault, "msg", None) or str(fault)
        raise ExpressionError(
            f"invalid expression: {reason}",
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
            remedy="move parts of the expression to [definitions]",
        ) from None
    return tree, names


def _of_number(number: float, place: Place | None) -> Expression:
    """Return the expression of a number, without parsing its text."""
    tree: ast.expr = ast.Constant(abs(number))
    if math.copysign(1.0, number) < 0.0:
        tree = ast.UnaryOp(ast.USub(), tree)
    expr: Expression = object.__new__(Expression)  # the constructor of a frozen class takes longer
    vars(expr).update(text=repr(number), names=_NO_NAMES, place=place, tree=tree)
    return expr


def require_names(expr: Expression, known: Iterable[str]) -> None:
    """Raise an error with similar names if the expression contains an unknown name."""
    unknown = expr.names.difference(known)
    if not unknown:
        return
    allowed = set(known)
    nodes = [n for n in ast.walk(expr.tree) if isinstance(n, ast.Name) and n.id in unknown]
    node = min(nodes, key=lambda n: getattr(n, "col_offset", 0))
    if node.id.lower() in ("nan", "inf", "infinity"):
        raise expr.error(f"'{node.id}' is not finite", node=node, remedy="use a finite number")
    remedy = nearest(node.id, allowed | set(FUNCTIONS) | set(CONSTANTS))
    if "did you mean" not in remedy:
        remedy = nearest(node.id, allowed)
    raise expr.error(f"unknown name '{node.id}'", node=node, remedy=remedy)


def substitute(expr: Expression, values: Mapping[str, Expression | str | float]) -> Expression:
    """Replace names by expressions in the tree, simultaneously.

    The result is checked like a parsed expression, with larger limits of its size, and keeps the place of ``expr``.
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
            f"'{_short(expr.text)}' is nested too deeply after its definitions are inserted",
            remedy="simplify the expression or its definitions",
        ) from None
    return Expression(text, names, expr.place, tree)


def of_tree(tree: ast.expr, place: Place | None = None) -> Expression:
    """Return an expression from a checked tree, which may contain internal names."""
    nodes = list(ast.walk(tree))
    functions = {id(node.func) for node in nodes if isinstance(node, ast.Call)}
    names = {node.id for node in nodes if isinstance(node, ast.Name) and id(node) not in functions}
    return Expression(write(tree), frozenset(names - CONSTANTS.keys()), place, tree)


def check_text(text: str, where: Place, also: str = "") -> None:
    """Reject a text that is empty or too long, or has invalid characters; ``also`` lists further valid characters."""
    if not text:
        raise ExpressionError(
            "the expression is empty", place=where, remedy="write a number or an expression"
        )
    if len(text) > MAX_LENGTH:
        raise ExpressionError(
            f"the expression has {len(text)} characters, but at most {MAX_LENGTH} are allowed",
            place=where.at(_short(text)),
            remedy="move parts of the expression to [definitions]",
        )
    for column, character in enumerate(text):
        if not (_ALLOWED.match(character) or character in also):
            shown = character if character.isprintable() else f"U+{ord(character):04X}"
            printable = "".join(c if c.isprintable() else "?" for c in text)
            advice = _ADVICE.get(
                character, "use ASCII letters, digits and _ in names (omega for the Greek letter)"
            )
            raise ExpressionError(
                f"the character '{shown}' is not allowed in an expression",
                place=where.at(printable, column),
                remedy=advice,
            )


def is_zero_dimensional(value: object) -> bool:
    """Return whether a value is a NumPy array without dimensions, which contains one number."""
    return getattr(value, "ndim", None) == 0 and hasattr(value, "__setitem__")  # unlike a NumPy number


def _as_text(quantity: Any, where: Place) -> str:
    """Return the text of a number or string, and reject other objects."""
    if isinstance(quantity, str):
        return quantity
    if isinstance(quantity, bool):
        return str(quantity)
    if is_zero_dimensional(quantity):
        return _as_text(quantity.item(), where)
    if isinstance(quantity, Integral):
        value = int(quantity)
        return str(value) if abs(value) <= MAX_INTEGER else repr(_double(value, where))
    if isinstance(quantity, Real):
        number = _double(quantity, where)
        if not math.isfinite(number):
            raise ExpressionError(f"{number} is not finite", place=where, remedy="use a finite number")
        return repr(number)
    raise ExpressionError(
        f"{_short(repr(quantity))} is not an expression",
        place=where,
        remedy='write a number, or an expression in quotes such as "sqrt(k/m)"',
    )


def _double(value: SupportsFloat, where: Place) -> float:
    try:
        return float(value)
    except OverflowError:
        raise ExpressionError(
            "the number is too large for a double", place=where, remedy="use a number below 1.8e308"
        ) from None


def _short(text: str, most: int = 60) -> str:
    return text if len(text) <= most else text[: most - 3] + "..."
