"""Whether the two branches of a conditional agree where its condition changes, as far as their form shows."""

from __future__ import annotations

import ast
from fractions import Fraction

from hybridsim.expr.polynomial import Polynomial, difference
from hybridsim.expr.rebuild import with_names
from hybridsim.model.meanings import Meanings


def is_continuous(meanings: Meanings, border: ast.expr, body: ast.expr, orelse: ast.expr) -> bool:
    """Whether body = orelse wherever border = 0.

    The border is solved for a name in which it is linear with a number as its coefficient, and the name put into the
    branches; they agree if their difference is then the polynomial 0.
    """
    border, body, orelse = (meanings.written_out(node) for node in (border, body, orelse))
    p = difference(border, ast.Constant(0))
    for name in sorted({factor for monomial in p for factor, _ in monomial}):
        if not name.isidentifier():
            continue
        others = {m: c for m, c in p.items() if m != ((name, 1),)}
        coefficient = p.get(((name, 1),))
        if coefficient is None or _depends(others, name):
            continue
        # border = coefficient*name + rest, so that name = name - border/coefficient where the border is zero
        value = ast.BinOp(
            ast.Name(name, ast.Load()), ast.Sub(), ast.BinOp(border, ast.Div(), _number(coefficient))
        )
        parts: dict[str, ast.expr] = {name: value}
        if not difference(with_names(body, parts), with_names(orelse, parts)):
            return True
    return False


def _depends(p: Polynomial, name: str) -> bool:
    """Whether a name occurs in a polynomial, also inside of what counts as a thing of its own."""
    factors = {factor for monomial in p for factor, _ in monomial}
    return any(name == factor or (not factor.isidentifier() and name in factor) for factor in factors)


def _number(value: Fraction) -> ast.expr:
    return ast.BinOp(ast.Constant(value.numerator), ast.Div(), ast.Constant(value.denominator))
