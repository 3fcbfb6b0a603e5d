"""Values of expressions in mpmath, by a tree walk of its own: the doubles as they are written, nothing simplified."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from typing import Any

import mpmath

FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{n: getattr(mpmath, n) for n in ("sin", "cos", "tan", "asin", "acos", "atan", "atan2")},
    **{n: getattr(mpmath, n) for n in ("sinh", "cosh", "tanh", "exp", "log", "sqrt", "sign")},
    "abs": abs,
    "min": min,
    "max": max,
}
OPERATIONS: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.Pow: mpmath.power,
    ast.Lt: lambda a, b: a < b,
    ast.LtE: lambda a, b: a <= b,
    ast.Gt: lambda a, b: a > b,
    ast.GtE: lambda a, b: a >= b,
    ast.Eq: lambda a, b: a == b,
    ast.NotEq: lambda a, b: a != b,
}


def evaluate(text: str, values: Mapping[str, Any]) -> Any:
    """The value of an expression at mpmath numbers, in the current precision."""
    return walk(ast.parse(text, mode="eval").body, values)


def walk(node: ast.expr, values: Mapping[str, Any]) -> Any:
    match node:
        case ast.Constant(value=number):
            return mpmath.mpf(number)
        case ast.Name(id="pi"):
            return +mpmath.pi
        case ast.Name(id=name):
            return values[name]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -walk(operand, values)
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return not walk(operand, values)
        case ast.BinOp(left=left, op=op, right=right):
            return OPERATIONS[type(op)](walk(left, values), walk(right, values))
        case ast.BoolOp(op=op, values=parts):
            decide = all if isinstance(op, ast.And) else any
            return decide(walk(part, values) for part in parts)
        case ast.Compare(left=left, ops=ops, comparators=others):
            terms = [walk(part, values) for part in (left, *others)]
            return all(OPERATIONS[type(op)](a, b) for op, a, b in zip(ops, terms, terms[1:], strict=False))
        case ast.IfExp(test=test, body=body, orelse=orelse):
            return walk(body if walk(test, values) else orelse, values)
        case ast.Call(func=ast.Name(id=name), args=args):
            return FUNCTIONS[name](*(walk(arg, values) for arg in args))
    raise TypeError(ast.dump(node))


def coefficients(text: str, motion: Callable[[Any], Mapping[str, Any]], order: int = 3) -> list[Any]:
    """Taylor coefficients at 0 of an expression along a motion, to some thirty digits."""
    with mpmath.workdps(70):
        return list(mpmath.taylor(lambda h: evaluate(text, motion(h)), 0, order, chop=False))
