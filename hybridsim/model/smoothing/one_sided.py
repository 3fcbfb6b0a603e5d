"""This module detects expressions that cannot be negative, such as squares."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping

from hybridsim.expr.grammar import CONSTANTS
from hybridsim.expr.walk import NoValue, value_of

Lookup = Callable[[str], ast.expr | None]
"""A function that returns the tree of a definition or variable, and None for any other name."""

_POSITIVE_CALLS = {
    "exp": "an exponential",
    "sqrt": "a root",
    "cosh": "a hyperbolic cosine",
    "abs": "an absolute value",
}


def never_negative(node: ast.expr, numbers: Mapping[str, float], lookup: Lookup) -> str | None:
    """Return the reason why an expression is never negative, such as "a square", or None.

    Parameters
    ----------
    numbers : values of the parameters.
    """
    constant = number_of(node, numbers, lookup)
    if constant is not None:
        return f"{constant:g}" if constant >= 0 else None

    def both(a: ast.expr, b: ast.expr) -> list[str] | None:
        found = [never_negative(part, numbers, lookup) for part in (a, b)]
        return [reason for reason in found if reason] if all(found) else None

    match node:
        case ast.Name(id=name) if (tree := lookup(name)) is not None:
            return never_negative(tree, numbers, lookup)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return never_negative(operand, numbers, lookup)
        case ast.BinOp(op=ast.Pow(), right=exponent):
            power = number_of(exponent, numbers, lookup)
            if power is None or power % 2:
                return None
            return "a square" if power == 2 else "an even power"
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            if ast.dump(left) == ast.dump(right):
                return "a square"
            return _factors(both(left, right), [left, right], numbers, lookup)
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            return _factors(both(left, right), [left, right], numbers, lookup)
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return "a sum of nonnegative terms" if both(left, right) else None
        case ast.IfExp(body=body, orelse=orelse):
            return "nonnegative on both sides of its condition" if both(body, orelse) else None
        case ast.Call(func=ast.Name(id="max"), args=args):
            reasons = [never_negative(argument, numbers, lookup) for argument in args]
            return "a maximum with a nonnegative term" if any(reasons) else None
        case ast.Call(func=ast.Name(id=name)):
            return _POSITIVE_CALLS.get(name)
    return None


def _factors(
    reasons: list[str] | None, parts: list[ast.expr], numbers: Mapping[str, float], lookup: Lookup
) -> str | None:
    """Return the reason why a product is never negative, from its factors."""
    if not reasons:
        return None
    varying = [r for r, part in zip(reasons, parts, strict=True) if number_of(part, numbers, lookup) is None]
    return varying[0] if len(varying) == 1 else "a product of nonnegative factors"


def number_of(node: ast.expr, numbers: Mapping[str, float], lookup: Lookup) -> float | None:
    """Return the value of an expression of numbers and known names, or None."""
    values: dict[str, float] = {}
    for name in names_of(node):
        if name in numbers:
            values[name] = numbers[name]
        elif (tree := lookup(name)) is not None and (value := number_of(tree, numbers, lookup)) is not None:
            values[name] = value
        else:
            return None
    try:
        return float(value_of(node, values))
    except NoValue:
        return None


def reached_names(node: ast.expr, lookup: Lookup) -> set[str]:
    """Return the names in an expression, and those in the definitions and variables that it reaches."""
    open_, seen = set(names_of(node)), set[str]()
    while open_:
        name = open_.pop()
        seen.add(name)
        tree = lookup(name)
        if tree is not None:
            open_ |= names_of(tree) - seen
    return seen


def names_of(node: ast.AST) -> frozenset[str]:
    """Return the names of quantities in a tree, without functions and constants; the result is cached."""
    found: frozenset[str] | None = getattr(node, "names_of", None)
    if found is None:
        if isinstance(node, ast.Name):
            found = frozenset() if node.id in CONSTANTS else frozenset((node.id,))
        else:
            parts = node.args if isinstance(node, ast.Call) else ast.iter_child_nodes(node)
            found = frozenset().union(*map(names_of, parts))
        node.names_of = found  # type: ignore[attr-defined]  # cache on the node
    return found
