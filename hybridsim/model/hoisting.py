"""Jumps inside of what is not linear in them: the whole expression jumps there, between its values on the two sides.

`exp(sign(x))` is `exp(1)` above and `exp(-1)` below. What a motion that slides along x = 0 gets of it is between these
two values, by the convention for rates, and not a value of the exponential in between.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from hybridsim.expr.rebuild import rebuilt
from hybridsim.model.conditions import TooManyConditions, single_comparisons
from hybridsim.model.meanings import Family, Meanings
from hybridsim.model.nonsmooth import sides_of

if TYPE_CHECKING:
    from hybridsim.model.rewriting import Here, Rewriting


def jump_inside(work: Rewriting, node: ast.expr, here: Here) -> ast.expr | None:
    """The border of a jump that does not enter a node linearly; None where all do.

    Jumps in time alone are left out: the modes, or signals, that stand for them have only two values.
    """
    match node:
        case ast.Call(args=args):
            parts = args
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            parts = [left, right]
        case ast.BinOp(op=ast.Div(), right=right):
            parts = [right]
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            first, second = (open_jumps(work, part, here) for part in (left, right))
            return next((first[family] for family in first if family in second), None)
        case ast.IfExp(body=body, orelse=orelse):
            parts = [body, orelse]
        case _:
            return None
    return next((border for part in parts for border in open_jumps(work, part, here).values()), None)


def open_jumps(work: Rewriting, node: ast.expr, here: Here) -> Mapping[Family, ast.expr]:
    """The borders at which a tree jumps in a way that surfaces stand for, by family."""
    if not work.has_jumps:
        return {}
    found: dict[Family, ast.expr] = {}
    for part in _parts(work.meanings, work.meanings.written_out(node)):
        sides = sides_of(part)
        if sides is None or not work.meanings.moves(sides[0]):
            continue
        family, _ = work.meanings.family(sides[0])
        if family in found or family in here.signs or not work.is_open(family, sides[0], here):
            continue
        if not work.agrees(part, sides):
            found[family] = sides[0]
    return found


def _parts(meanings: Meanings, tree: ast.expr) -> Iterator[ast.expr]:
    """All parts of a tree that may not be smooth, conditions taken apart."""
    for part in ast.walk(tree):
        if isinstance(part, ast.IfExp) and meanings.moves(part.test):
            try:
                single = single_comparisons(meanings, part)
            except TooManyConditions:
                continue
            if single is part:
                yield part
            else:
                yield from _parts(meanings, single)
        elif isinstance(part, ast.Call):
            yield part


def resolved(meanings: Meanings, node: ast.expr, signs: Mapping[Family, int]) -> ast.expr:
    """A tree, its definitions put in, where signs are known: what hangs on them has the side that holds."""

    def side(part: ast.expr) -> ast.expr:
        sides = sides_of(part)
        if sides is not None and meanings.moves(sides[0]):
            family, own = meanings.family(sides[0])
            if family in signs:
                return side(sides[(3, 1, 2)[own * signs[family]]])
        return rebuilt(part, side)

    return side(meanings.written_out(node))
