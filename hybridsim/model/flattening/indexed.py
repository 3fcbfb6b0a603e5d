"""This module parses expressions with the index i of repeated parts, and references such as block[i-1].x."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from hybridsim.errors import ExpressionError, Place, nearest
from hybridsim.expr.check import check_size, check_tree
from hybridsim.expr.grammar import MAX_DEPTH, MAX_LENGTH
from hybridsim.expr.parse import Expression, check_text, checked_tree, one_line, parse
from hybridsim.expr.python_tree import with_dotted_names
from hybridsim.expr.rebuild import rebuilt
from hybridsim.expr.walk import NoValue, value_of
from hybridsim.expr.write import write

INDEX = "i"
_FORM = "write a reference as NAME[INDEX].QUANTITY, such as block[i-1].x"
_ENDS = "give the ends a value of their own by a condition on i, such as 'block[i-1].x if i > 1 else 0'"


@dataclass(frozen=True)
class Reference:
    """A quantity of a numbered part, such as block[i-1].x, and the column at which it is written."""

    part: str
    index: ast.expr
    quantity: str
    column: int


@dataclass(frozen=True)
class IndexedExpression:
    """An expression with an index, which gives an ordinary expression for each number of a repeated part.

    Parameters
    ----------
    text : source text.
    place : place of the declaration.
    tree : the checked tree, in which a reference has the name ``[k]`` with its position k in ``references``.
    references : the references to numbered parts.
    """

    text: str
    place: Place | None = field(compare=False, repr=False)
    tree: ast.expr = field(compare=False, repr=False)
    references: tuple[Reference, ...] = field(default=(), compare=False, repr=False)

    def at(self, number: int | None, repeats: Mapping[str, int]) -> Expression:
        """Return the expression without an index, for the copy of a part that has a given number.

        A condition on i alone is decided first, so that the other branch need not exist. ``block[3].x`` becomes
        ``block3.x``.

        Parameters
        ----------
        number : value of i, or None for a part that is not repeated.
        repeats : number of copies of each repeated part.
        """
        values = {} if number is None else {INDEX: float(number)}

        def folded(node: ast.expr) -> ast.expr:
            match node:
                case ast.Name(id=name) if name in values:
                    return ast.Constant(number)
                case ast.Name(id=name) if name.startswith("["):
                    return ast.Name(self._name(self.references[int(name[1:-1])], values, repeats), ast.Load())
                case ast.IfExp(test=test, body=body, orelse=orelse) if values and _names(test) == {INDEX}:
                    return folded(body if self._value(test, values) else orelse)
            return rebuilt(node, folded)

        if not self.references and not (values and INDEX in _names(self.tree)):
            return parse(self.text, self.place)
        return parse(write(folded(self.tree)), self.place)

    def _name(self, reference: Reference, values: Mapping[str, float], repeats: Mapping[str, int]) -> str:
        """Return the name of a referenced quantity in the whole model."""
        part, column = reference.part, reference.column
        if part not in repeats:
            known = nearest(part, repeats, kind="repeated parts")
            raise self._fail(f"there is no repeated part '{part}'", column, known)
        if _names(reference.index) - values.keys():
            name = min(_names(reference.index) - values.keys())
            remedy = "use whole numbers, and the index i of a part with `repeat`"
            raise self._fail(f"'{name}' cannot be used in an index", column, remedy)
        index = self._value(reference.index, values)
        if not float(index).is_integer():
            raise self._fail(
                f"the index of '{part}' is {index:g}", column, "use an index that is a whole number"
            )
        if not 1 <= index <= repeats[part]:
            message = f"{part}[{index:g}] does not exist: '{part}' has the numbers 1 to {repeats[part]}"
            raise self._fail(message, column, _ENDS)
        return f"{part}{index:.0f}.{reference.quantity}"

    def _value(self, node: ast.expr, values: Mapping[str, float]) -> float:
        try:
            return value_of(node, values)
        except NoValue as fault:
            message = f"'{write(node)}' has no value for i = {values.get(INDEX, math.nan):g}: {fault.reason}"
            raise self._fail(
                message, 0, "write the index with the letter i, whole numbers, sums and products"
            ) from None

    def _fail(self, message: str, column: int, remedy: str) -> ExpressionError:
        return ExpressionError(message, place=(self.place or Place()).at(self.text, column), remedy=remedy)


def parse_indexed(
    value: str | float | Expression | IndexedExpression, place: Place | None
) -> IndexedExpression:
    """Parse a number or a text that may refer to numbered parts.

    Raises
    ------
    ExpressionError
        For a text that is not an expression, or a reference of another form.
    """
    if isinstance(value, IndexedExpression):
        return value
    if not (isinstance(value, str) and "[" in value):
        expr = parse(value, place)
        return IndexedExpression(expr.text, expr.place, expr.tree)
    where, text = place or Place(), one_line(value)
    check_text(text, where, also="[]")
    joined = _Joined(text, where)
    tree, _ = checked_tree(text, where, lambda tree: with_dotted_names(joined.visit(tree)))
    return IndexedExpression(text, place, tree, tuple(joined.found))


class _Joined(ast.NodeTransformer):
    """Replaces each reference to a numbered part by a name, and stores the references."""

    def __init__(self, text: str, place: Place) -> None:
        self.text = text
        self.place = place
        self.found: list[Reference] = []

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        """Replace a reference such as block[i].x by a name; return any other node unchanged."""
        path, owner = [node.attr], node.value
        while isinstance(owner, ast.Attribute):
            path.append(owner.attr)
            owner = owner.value
        if not isinstance(owner, ast.Subscript):
            return node
        if not isinstance(owner.value, ast.Name):
            remedy = f"{_FORM}; a repeated part inside a part has names such as left.block3.x"
            raise ExpressionError(
                "an index can follow only the name of a part of this model",
                place=self._at(owner),
                remedy=remedy,
            )
        check_size(owner.slice, self.text, self.place, MAX_DEPTH, MAX_LENGTH)
        check_tree(owner.slice, self.text, self.place)
        quantity = ".".join(reversed(path))
        self.found.append(Reference(owner.value.id, owner.slice, quantity, owner.col_offset))
        return ast.copy_location(ast.Name(f"[{len(self.found) - 1}]", ast.Load()), node)

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        """Reject a subscript without a quantity after it."""
        message = f"'{ast.unparse(node)}' is a part and has no value"
        raise ExpressionError(message, place=self._at(node), remedy=_FORM)

    def _at(self, node: ast.expr) -> Place:
        return self.place.at(self.text, node.col_offset)


def _names(node: ast.expr) -> set[str]:
    return {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
