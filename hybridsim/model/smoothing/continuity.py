"""This module detects conditionals and signs whose products are continuous."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Set

from hybridsim.expr.grammar import is_name
from hybridsim.expr.polynomial import Polynomial, difference, is_multiple, number_tree, polynomial
from hybridsim.expr.rebuild import exchanged, with_names
from hybridsim.model.meanings import Family, Meanings
from hybridsim.model.smoothing.nonsmooth import Sides, is_whole

_POWER_OF_ZERO = re.compile(r"\(0\)\*\*\((?!-)")


def is_continuous(meanings: Meanings, border: ast.expr, body: ast.expr, orelse: ast.expr) -> bool:
    """Return whether polynomials show that two expressions are equal wherever `border` is zero.

    They agree if their difference is a multiple of the border, or vanishes when the border is solved for one of its
    names. A power of zero with a parameter as exponent counts as zero.
    """
    first, second = (meanings.written_out(node) for node in (body, orelse))
    written = meanings.written_out(border)
    for part in _solved(written):
        apart = difference(*(with_names(branch, part) for branch in (first, second)))
        if all(any(map(_POWER_OF_ZERO.match, dict(monomial))) for monomial in apart):
            return True
    return is_multiple(difference(first, second), polynomial(written))


def _solved(border: ast.expr) -> Iterator[dict[str, ast.expr]]:
    """Solve border = 0 for each name in which `border` is linear, and yield the solutions."""
    p = difference(border, ast.Constant(0))
    for name in sorted({factor for monomial in p for factor, _ in monomial}):
        if not is_name(name):
            continue
        others = {m: c for m, c in p.items() if m != ((name, 1),)}
        coefficient = p.get(((name, 1),))
        if coefficient is None or _depends(others, name):
            continue
        rest = with_names(border, {name: ast.Constant(0)})
        yield {name: ast.BinOp(rest, ast.Div(), number_tree(-coefficient))}


def sides_of_product(meanings: Meanings, node: ast.expr, left: Set[Family] = frozenset()) -> Sides | None:
    """Return the two sides of a continuous product with a sign, such as sign(v)*v**2, or None.

    Signs with borders in `left` are ignored.
    """
    for part, u in _signs_in(meanings, node):
        if meanings.family(u)[0] not in left:
            above, below = (exchanged(node, part, ast.Constant(value)) for value in (1, -1))
            if is_continuous(meanings, u, above, below):
                return u, above, below, above
    return None


def rooted_in(meanings: Meanings, node: ast.expr) -> frozenset[Family]:
    """Return the signs of a continuous product that jump at a point where a root in the product is zero.

    An example is sign(d)*sqrt(abs(d)), which has no Taylor series at d = 0 on either side.
    """
    found = set()
    bases = _bases_in(meanings, node)
    for part, u in _signs_in(meanings, node) if bases else ():
        above, below = (exchanged(node, part, ast.Constant(value)) for value in (1, -1))
        if is_continuous(meanings, u, above, below) and any(
            is_continuous(meanings, u, base, ast.Constant(0)) for base in bases
        ):
            found.add(meanings.family(u)[0])
    return frozenset(found)


def _signs_in(meanings: Meanings, node: ast.expr) -> Iterator[tuple[ast.expr, ast.expr]]:
    """Yield the signs of varying expressions in a tree, each with its argument."""
    for part in ast.walk(node):
        match part:
            case ast.Call(func=ast.Name(id="sign"), args=[u]) if meanings.moves(u):
                yield part, u


def _bases_in(meanings: Meanings, node: ast.expr) -> list[ast.expr]:
    """Return the arguments of roots and the bases of fractional powers."""
    parts = list(ast.walk(meanings.written_out(node)))
    bases = [p.args[0] for p in parts if isinstance(p, ast.Call) and ast.unparse(p.func) == "sqrt"]
    powers = [p for p in parts if isinstance(p, ast.BinOp) and isinstance(p.op, ast.Pow)]
    return bases + [power.left for power in powers if not is_whole(power.right, meanings)]


def has_root_beside_sign(meanings: Meanings, node: ast.expr) -> bool:
    """Return whether a product with a sign contains a root that is zero at the jump of the sign."""
    parts = list(ast.walk(meanings.written_out(node)))
    borders = [p.args[0] for p in parts if isinstance(p, ast.Call) and ast.unparse(p.func) == "sign"]
    if not borders:
        return False
    bases = _bases_in(meanings, node)
    return any(is_continuous(meanings, u, base, ast.Constant(0)) for u in borders for base in bases)


def _depends(p: Polynomial, name: str) -> bool:
    """Return whether a polynomial depends on a name, directly or inside a factor that is not a name."""
    factors = {factor for monomial in p for factor, _ in monomial}
    return any(name == factor or (not is_name(factor) and name in factor) for factor in factors)
