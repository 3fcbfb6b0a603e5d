"""Conditions taken apart: a conditional of any Boolean combination as conditionals of single comparisons.

`a if p and q else b` is `(a if q else b) if p else b`, and so for `or`, `not`, chains and conditions that depend on
conditions. A comparison with a corner or a jump inside is one of what is smooth: `abs(u) < d` is `u < d and -u < d`. A
conditional that is an absolute value or a maximum of what it compares becomes that: `u if u > 0 else -u` is `abs(u)`.
"""

from __future__ import annotations

import ast
from fractions import Fraction

from hybridsim.expr.polynomial import difference, number_tree, polynomial, scaled
from hybridsim.expr.rebuild import exchanged
from hybridsim.model.meanings import Meanings
from hybridsim.model.nonsmooth import Sides, sides_of

# A conditional of more single comparisons is left as it stands: each of them may double what comes after it.
_MOST_COMPARISONS = 64


class TooManyConditions(Exception):
    """A condition falls into more single comparisons than are taken apart."""


def single_comparisons(meanings: Meanings, node: ast.IfExp) -> ast.expr:
    """The same value by conditionals of single comparisons of smooth sides; the node itself where it is one.

    Raises
    ------
    TooManyConditions
        Where that would be too long.
    """
    conditions = _Conditions(meanings)
    return conditions.corner(node) or conditions.chosen(node.test, node.body, node.orelse, node)


class _Conditions:
    """One condition on its way."""

    def __init__(self, meanings: Meanings) -> None:
        self.meanings, self.count = meanings, 0

    def chosen(self, test: ast.expr, yes: ast.expr, no: ast.expr, whole: ast.IfExp | None = None) -> ast.expr:
        """What has the value `yes` where a test holds, else `no`. whole: a tree that says so, if there is one."""
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
                return self._compared(ast.BinOp(left, ast.Sub(), right), op, yes, no) or self._one(
                    test, yes, no, whole
                )
        return self._one(test, yes, no, whole)

    def _one(self, test: ast.expr, yes: ast.expr, no: ast.expr, whole: ast.IfExp | None) -> ast.expr:
        self.count += 1
        if self.count > _MOST_COMPARISONS:
            raise TooManyConditions
        return whole if whole is not None and whole.test is test else ast.IfExp(test, yes, no)

    def _compared(self, apart: ast.expr, op: ast.cmpop, yes: ast.expr, no: ast.expr) -> ast.expr | None:
        """The choice by a comparison of an expression with zero that is not smooth; None where it is smooth."""
        tree = self.meanings.written_out(apart)
        match tree:
            case ast.BinOp(
                left=ast.BinOp(left=first, op=ast.Mult() | ast.Div(), right=second),
                right=ast.Constant(value=0 | 0.0),
            ) if self.meanings.moves(first) and self.meanings.moves(
                second
            ):  # of one sign, or of different ones
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
            if is_largest == (factor > 0):  # the larger of two is above what one of the two is above
                joined: ast.boolop = ast.Or() if isinstance(op, ast.Gt | ast.GtE) else ast.And()
            else:
                joined = ast.And() if isinstance(op, ast.Gt | ast.GtE) else ast.Or()
            return self.chosen(ast.BoolOp(joined, [side(above), side(below)]), yes, no)
        test = ast.Compare(argument, [ast.Gt()], [ast.Constant(0)])
        first, second = (self.chosen(side(value), yes, no) for value in (above, below))
        return self.chosen(test, first, second)

    def _rough(self, tree: ast.expr) -> tuple[ast.expr | None, Sides | None]:
        """The first part of a tree that moves and is not smooth, and its sides."""
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
        """A conditional as abs or max of what it compares, where that is not smooth; None where it is neither.

        It is if its branches differ by a multiple of what it compares, which then is not taken apart.
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
        """The number by which a tree is a multiple of an abs, min or max, plus what does not contain it; else 0."""
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
