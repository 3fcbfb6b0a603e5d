"""Evaluate a checked tree in double precision by a recursive walk, and find calls that jump."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Iterator, Mapping

from hybridsim.expr.grammar import CONSTANTS, FUNCTIONS, STAIRS

_BINARY: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: math.pow,
}
_COMPARE: dict[type[ast.cmpop], Callable[[float, float], bool]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}


class NoValue(Exception):
    """Raised if a node has no finite real value; the text gives the reason."""

    def __init__(self, node: ast.expr, reason: str) -> None:
        super().__init__(reason)
        self.node = node
        self.reason = reason


def value_of(node: ast.expr, values: Mapping[str, float]) -> float | bool:
    """Return the value of a checked node, or raise `NoValue` (no finite real value) or KeyError."""
    match node:
        case ast.Constant(value=bool() as truth):
            return truth
        case ast.Constant(value=(int() | float()) as number):
            return float(number)
        case ast.Name(id=name):
            return CONSTANTS[name] if name in CONSTANTS else float(values[name])
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return not value_of(operand, values)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -value_of(operand, values)
        case ast.UnaryOp(operand=operand):
            return value_of(operand, values)
        case ast.BinOp(left=left, op=op, right=right):
            first, second = value_of(left, values), value_of(right, values)
            return _finite(node, _BINARY[type(op)], first, second)
        case ast.BoolOp(op=ast.And(), values=parts):
            return all(value_of(part, values) for part in parts)
        case ast.BoolOp(values=parts):
            return any(value_of(part, values) for part in parts)
        case ast.Compare(left=left, ops=ops, comparators=others):
            terms = [value_of(part, values) for part in (left, *others)]
            return all(_COMPARE[type(op)](a, b) for op, a, b in zip(ops, terms[:-1], terms[1:], strict=True))
        case ast.IfExp(test=test, body=body, orelse=orelse):
            return value_of(body if value_of(test, values) else orelse, values)
        case ast.Call(func=ast.Name(id=name), args=args):
            return _finite(node, FUNCTIONS[name].value, *(value_of(arg, values) for arg in args))
    raise TypeError(f"a checked expression cannot contain {ast.dump(node)}")


def stairs_in(tree: ast.AST) -> Iterator[ast.Call]:
    """Yield the calls of floor, mod and round in a tree."""
    for part in ast.walk(tree):
        if isinstance(part, ast.Call) and isinstance(part.func, ast.Name) and part.func.id in STAIRS:
            yield part


def _finite(node: ast.expr, function: Callable[..., float], *arguments: float) -> float:
    try:
        value = float(function(*arguments))
    except ZeroDivisionError:
        raise NoValue(node, "division by zero") from None
    except OverflowError:
        raise NoValue(node, "the result is too large for a double") from None
    except ValueError:
        shown = ", ".join(f"{argument:g}" for argument in arguments)
        raise NoValue(node, f"the function is not defined at ({shown})") from None
    if not math.isfinite(value):
        raise NoValue(node, f"the result is {value}")
    return value
