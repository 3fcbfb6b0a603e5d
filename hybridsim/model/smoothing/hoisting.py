"""This module finds jumps inside nonlinear expressions, so that the whole expression is treated as a jump.

`exp(sign(x))` is `exp(1)` above and `exp(-1)` below x = 0. While a motion slides along x = 0, the term is a convex
combination of these two values, by Filippov's convention, and not the exponential of an intermediate value.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping

from hybridsim.model.meanings import Family, Meanings
from hybridsim.model.smoothing.conditions import TooManyConditions, single_comparisons
from hybridsim.model.smoothing.nonsmooth import sides_of
from hybridsim.model.smoothing.rewriting_state import Here, RewritingState


def jump_inside(work: RewritingState, node: ast.expr, here: Here) -> ast.expr | None:
    """Return the argument of a jump on which a tree depends nonlinearly, or None if there is no such jump.

    Jumps that depend on time alone are excluded, because the modes or signals for them have only two values.
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


def open_jumps(work: RewritingState, node: ast.expr, here: Here) -> Mapping[Family, ast.expr]:
    """Return the arguments of the jumps in a tree that switching surfaces can replace."""
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
    """Yield all parts of a tree that may be non-smooth."""
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
