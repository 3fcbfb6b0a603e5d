"""This module copies syntax trees and changes parts of the copies."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping

Change = Callable[[ast.expr], ast.expr]


def rebuilt(node: ast.expr, change: Change) -> ast.expr:
    """Return a copy of a node with a function applied to its direct parts."""
    match node:
        case ast.UnaryOp(op=op, operand=operand):
            return ast.UnaryOp(op, change(operand))
        case ast.BinOp(left=left, op=operator, right=right):
            return ast.BinOp(change(left), operator, change(right))
        case ast.BoolOp(op=boolean, values=values):
            return ast.BoolOp(boolean, [change(value) for value in values])
        case ast.Compare(left=left, ops=ops, comparators=others):
            return ast.Compare(change(left), ops, [change(other) for other in others])
        case ast.IfExp(test=test, body=body, orelse=orelse):
            return ast.IfExp(change(test), change(body), change(orelse))
        case ast.Call(func=func, args=args):
            return ast.Call(func, [change(argument) for argument in args], [])
        case _:
            return node


def with_names(node: ast.expr, parts: Mapping[str, ast.expr]) -> ast.expr:
    """Return a tree in which names are replaced simultaneously by other trees."""
    if isinstance(node, ast.Name):
        return parts.get(node.id, node)
    return rebuilt(node, lambda part: with_names(part, parts))


def exchanged(node: ast.expr, old: ast.expr, new: ast.expr) -> ast.expr:
    """Return a tree in which all occurrences of one part are replaced by another part."""
    text = ast.dump(old)

    def change(part: ast.expr) -> ast.expr:
        return new if type(part) is type(old) and ast.dump(part) == text else rebuilt(part, change)

    return change(node)
