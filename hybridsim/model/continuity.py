"""Whether what a conditional or a sign makes of an expression agrees where it changes, as far as its form shows."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from hybridsim.expr.polynomial import Polynomial, difference, number_tree
from hybridsim.expr.rebuild import exchanged, with_names
from hybridsim.model.meanings import Meanings
from hybridsim.model.nonsmooth import Sides, is_whole


def is_continuous(meanings: Meanings, border: ast.expr, body: ast.expr, orelse: ast.expr) -> bool:
    """Whether body = orelse wherever border = 0: they agree if their difference is the polynomial 0 there."""
    branches = [meanings.written_out(node) for node in (body, orelse)]
    for part in _solved(meanings.written_out(border)):
        if not difference(*(with_names(branch, part) for branch in branches)):
            return True
    return False


def _solved(border: ast.expr) -> Iterator[dict[str, ast.expr]]:
    """What the names in a border are where it is zero, of those in which it is linear with a number as coefficient."""
    p = difference(border, ast.Constant(0))
    for name in sorted({factor for monomial in p for factor, _ in monomial}):
        if not name.isidentifier():
            continue
        others = {m: c for m, c in p.items() if m != ((name, 1),)}
        coefficient = p.get(((name, 1),))
        if coefficient is None or _depends(others, name):
            continue
        rest = with_names(border, {name: ast.Constant(0)})
        yield {name: ast.BinOp(rest, ast.Div(), number_tree(-coefficient))}


def sides_of_product(meanings: Meanings, node: ast.expr) -> Sides | None:
    """The sides of a product with a sign in it that vanishes where the sign changes, as sign(v)*v**2 does."""
    for part in ast.walk(node):
        match part:
            case ast.Call(func=ast.Name(id="sign"), args=[u]) if meanings.moves(u):
                above, below = (exchanged(node, part, ast.Constant(value)) for value in (1, -1))
                if is_continuous(meanings, u, above, below):
                    return u, above, below, above
    return None


def has_root_beside_sign(meanings: Meanings, node: ast.expr) -> bool:
    """Whether a product with a sign has a root, or a power that is not whole, of what is zero where it jumps."""
    parts = list(ast.walk(meanings.written_out(node)))
    borders = [p.args[0] for p in parts if isinstance(p, ast.Call) and ast.unparse(p.func) == "sign"]
    if not borders:
        return False
    bases = [p.args[0] for p in parts if isinstance(p, ast.Call) and ast.unparse(p.func) == "sqrt"]
    powers = [p for p in parts if isinstance(p, ast.BinOp) and isinstance(p.op, ast.Pow)]
    bases += [power.left for power in powers if not is_whole(power.right, meanings)]
    return any(is_continuous(meanings, u, base, ast.Constant(0)) for u in borders for base in bases)


def _depends(p: Polynomial, name: str) -> bool:
    """Whether a name occurs in a polynomial, also inside of what counts as a thing of its own."""
    factors = {factor for monomial in p for factor, _ in monomial}
    return any(name == factor or (not factor.isidentifier() and name in factor) for factor in factors)
