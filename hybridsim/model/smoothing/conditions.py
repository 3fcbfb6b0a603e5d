"""This module splits conditions with `and`, `or` and `not` into single comparisons.

`a if p and q else b` becomes `(a if q else b) if p else b`; `or`, `not`, chains and nested conditions are split too.
A comparison with a corner or jump inside is replaced by comparisons of smooth expressions: `abs(u) < d` becomes
`u < d and -u < d`. A conditional that equals abs or max is replaced by it: `u if u > 0 else -u` becomes `abs(u)`.
"""

from __future__ import annotations

import ast
from fractions import Fraction

from hybridsim.expr.polynomial import difference, number_tree, polynomial, scaled
from hybridsim.expr.rebuild import exchanged
from hybridsim.model.meanings import Meanings
from hybridsim.model.smoothing.nonsmooth import Sides, sides_of

# Largest number of single comparisons of one conditional; each may double the size of the following ones.
_MOST_COMPARISONS = 64


class TooManyConditions(Exception):
    """Raised if a condition would be split into too many single comparisons."""


def single_comparisons(meanings: Meanings, node: ast.IfExp) -> ast.expr:
    """Return an equivalent expression in which every condition is a single smooth comparison.

    Raises
    ------
    TooManyConditions
        If the result would be too long.
    """
    return _Conditions(meanings).chosen(node.test, node.body, node.orelse, node)


class _Conditions:
    """Converts one conditional expression."""

    def __init__(self, meanings: Meanings) -> None:
        self.meanings, self.count = meanings, 0

    def chosen(self, test: ast.expr, yes: ast.expr, no: ast.expr, whole: ast.IfExp | None = None) -> ast.expr:
        """Return an expression that is `yes` if the test is true, otherwise `no`."""
        match test:
            case ast.Constant(value=bool() as holds):
                return yes if holds else no
            case ast.BoolOp(op=op, values=[first, *others]):
                rest = first if not others else others[0] if len(others) == 1 else ast.BoolOp(op, others)
                if not others:
                    return self.chosen(first, yes, no)
                if isinstance(op, ast.And):
                    return self.chosen(first, self.chosen(rest, yes, no), no)
                return self.chosen(first, yes, self.chosen(rest, yes, no))
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return self.chosen(operand, no, yes)
            case ast.IfExp(test=inner, body=first, orelse=second):
                return self.chosen(inner, self.chosen(first, yes, no), self.chosen(second, yes, no))
            case ast.Compare(left=left, ops=[op, *ops], comparators=[right, *others]) if others:
                rest = ast.Compare(right, ops, others)
                return self.chosen(ast.Compare(left, [op], [right]), self.chosen(rest, yes, no), no)
            case ast.Compare(left=left, ops=[op], comparators=[right]) if isinstance(
                op, ast.Gt | ast.GtE | ast.Lt | ast.LtE
            ):
                return (
                    self.corner(ast.IfExp(test, yes, no))
                    or self._compared(ast.BinOp(left, ast.Sub(), right), op, yes, no)
                    or self._one(test, yes, no, whole)
                )
        return self._one(test, yes, no, whole)

    def _one(self, test: ast.expr, yes: ast.expr, no: ast.expr, whole: ast.IfExp | None) -> ast.expr:
        self.count += 1
        if self.count > _MOST_COMPARISONS:
            raise TooManyConditions
        return whole if whole is not None and whole.test is test else ast.IfExp(test, yes, no)

    def _compared(self, apart: ast.expr, op: ast.cmpop, yes: ast.expr, no: ast.expr) -> ast.expr | None:
        """Split a comparison of a non-smooth expression with zero, or return None for a smooth expression."""
        tree = self.meanings.written_out(apart)
        match tree:
            case ast.BinOp(
                left=ast.BinOp(left=first, op=ast.Mult() | ast.Div(), right=second),
                right=ast.Constant(value=0 | 0.0),
            ) if self.meanings.moves(first) and self.meanings.moves(
                second
            ):  # the sign of a product follows from the signs of both factors
                zero = ast.Constant(0)
                other = ast.Compare(zero, [op], [second])
                one = ast.Compare(second, [op], [zero])
                test = ast.Compare(first, [ast.Gt()], [zero])
                return self.chosen(test, self.chosen(one, yes, no), self.chosen(other, yes, no))
        node, parts = self._rough(tree)
        if node is None:
            return None

        def side(value: ast.expr) -> ast.expr:
            return ast.Compare(exchanged(tree, node, value), [op], [ast.Constant(0)])

        if parts is None:  # a conditional of several comparisons
            assert isinstance(node, ast.IfExp)
            first, second = (self.chosen(side(value), yes, no) for value in (node.body, node.orelse))
            return self.chosen(node.test, first, second)
        argument, above, below, _ = parts
        if factor := self._factor(tree, node):
            is_largest = isinstance(node, ast.Call) and ast.unparse(node.func) != "min"
            if is_largest == (factor > 0):  # max(a, b) > c is a > c or b > c
                joined: ast.boolop = ast.Or() if isinstance(op, ast.Gt | ast.GtE) else ast.And()
            else:
                joined = ast.And() if isinstance(op, ast.Gt | ast.GtE) else ast.Or()
            return self.chosen(ast.BoolOp(joined, [side(above), side(below)]), yes, no)
        test = ast.Compare(argument, [ast.Gt()], [ast.Constant(0)])
        first, second = (self.chosen(side(value), yes, no) for value in (above, below))
        return self.chosen(test, first, second)

    def _rough(self, tree: ast.expr) -> tuple[ast.expr | None, Sides | None]:
        """Return the first non-smooth varying part of a tree, and the values of this part on both sides."""
        for part in ast.walk(tree):
            if isinstance(part, ast.Call | ast.IfExp) and self.meanings.moves(part):
                if isinstance(part, ast.Call) and len(part.args) > 2:
                    inner = ast.Call(part.func, part.args[:-1], [])
                    return part, sides_of(ast.Call(part.func, [inner, part.args[-1]], []))
                sides = sides_of(part)
                if sides is not None or isinstance(part, ast.IfExp):
                    return part, sides
        return None, None

    def corner(self, node: ast.IfExp) -> ast.expr | None:
        """Return a conditional expression as abs or max, or None if neither form is equal to it.

        The condition is that the branches differ by a multiple of the compared expression.
        """
        sides = sides_of(node)
        if sides is None:
            return None
        border, above, below, _ = sides
        written, below_zero = self.meanings.written_out(border), self.meanings.written_out(below)
        if self._rough(written)[0] is None:
            return None
        whole, apart = polynomial(written), difference(self.meanings.written_out(above), below_zero)
        factors = {apart.get(monomial, 0) / factor for monomial, factor in whole.items()}
        if apart.keys() != whole.keys() or len(factors) != 1:
            return None
        factor = Fraction(factors.pop())
        size = ast.Call(ast.Name("abs", ast.Load()), [border], [])
        if abs(factor) == 2 and polynomial(below_zero) == scaled(whole, -factor / 2):
            return size if factor > 0 else ast.UnaryOp(ast.USub(), size)
        larger = ast.Call(ast.Name("max", ast.Load()), [border, ast.Constant(0)], [])
        return ast.BinOp(below, ast.Add(), ast.BinOp(number_tree(factor), ast.Mult(), larger))

    def _factor(self, tree: ast.expr, node: ast.expr) -> float:
        """Return the coefficient of a function in a tree. It is 0 if the tree is not linear in the function."""
        if not (isinstance(node, ast.Call) and ast.unparse(node.func) in ("abs", "min", "max")):
            return 0.0
        slopes = [
            difference(exchanged(tree, node, ast.Constant(k + 1)), exchanged(tree, node, ast.Constant(k)))
            for k in (0, 1)
        ]
        if slopes[0] != slopes[1] or set(slopes[0]) != {()}:
            return 0.0
        rest = exchanged(tree, node, ast.Constant(0))
        whole = ast.BinOp(rest, ast.Add(), ast.BinOp(number_tree(slopes[0][()]), ast.Mult(), node))
        return float(slopes[0][()]) if polynomial(whole) == polynomial(tree) else 0.0
