"""This module bounds the rounding error of the value of an expression."""

from __future__ import annotations

import ast
import itertools
import math
import operator
from collections.abc import Collection, Mapping
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache

from hybridsim.expr.parse import Expression
from hybridsim.expr.walk import NoValue, value_of

_MAX_DIGITS = 24  # 5**25 has 18 digits, and the shortest text of a double has at most 17
_UNIT = 2.0**-53  # unit roundoff of a double
_EXACT = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv}
_WIDER = (
    2.0**10
)  # factor on the errors of arguments for a finite difference, since the errors are near roundoff
_OF_FUNCTIONS = 2.0  # error bound of the functions of the math library, in units of roundoff


@lru_cache(maxsize=4096)
def own_roundoff(number: float) -> float:
    """Return the rounding error of a decimal number: half a unit in the last place of the double.

    The error is zero if the shortest decimal form equals the double exactly (3, 0.5).
    """
    if not math.isfinite(number) or number.is_integer():
        return 0.0
    # the exact value n/2**k has the digits of n*5**k, which are more than a double's text can have for large k
    digits = number.as_integer_ratio()[1].bit_length() - 1
    is_exact = digits <= _MAX_DIGITS and Decimal(repr(number)) == Decimal(number)
    return 0.0 if is_exact else 0.5 * math.ulp(number)


def rounding_of(expr: Expression, values: Mapping[str, float], exact: Collection[str] = ()) -> float:
    """Return a bound of the rounding error of an expression's value.

    `exact` lists names whose values have no error. All other numbers have the error of `own_roundoff`.
    """
    return _with_error(expr.tree, values, exact)[1]


def has_rounded_number(expr: Expression) -> bool:
    """Return whether an expression contains a decimal number that is not exact as a double."""
    numbers = [node.value for node in ast.walk(expr.tree) if isinstance(node, ast.Constant)]
    return any(isinstance(number, float) and own_roundoff(number) > 0.0 for number in numbers)


def _with_error(node: ast.expr, values: Mapping[str, float], exact: Collection[str]) -> tuple[float, float]:
    value = float(value_of(node, values))
    match node:
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            return value, _with_error(operand, values, exact)[1]
        case ast.IfExp(test=test, body=body, orelse=orelse):
            return _with_error(body if value_of(test, values) else orelse, values, exact)
        case ast.BinOp(left=left, op=op, right=right):
            (a, da), (b, db) = _with_error(left, values, exact), _with_error(right, values, exact)
            if isinstance(op, ast.Pow):
                return value, _carried(node, [(a, da), (b, db)], value)
            off = float(abs(_EXACT[type(op)](Fraction(a), Fraction(b)) - Fraction(value)))
            if isinstance(op, ast.Mult):
                return value, abs(a) * db + da * (abs(b) + db) + off
            if isinstance(op, ast.Div):
                least = abs(b) - db
                return value, ((da + abs(value) * db) / least if least > 0.0 else math.inf) + off
            return value, da + db + off
        case ast.Name(id=name) if name in exact:
            return value, 0.0
        case ast.Name() | ast.Constant(value=int() | float()):
            return value, own_roundoff(value)
        case ast.Call(args=args):
            return value, _carried(node, [_with_error(arg, values, exact) for arg in args], value)
    return value, 0.0


def _carried(node: ast.BinOp | ast.Call, arguments: list[tuple[float, float]], value: float) -> float:
    """Return the error of a function's value: its own rounding, and the errors of its arguments."""
    names = [f"a{k}" for k in range(len(arguments))]
    parts: list[ast.expr] = [ast.Name(name) for name in names]
    again = (
        ast.BinOp(parts[0], node.op, parts[1])
        if isinstance(node, ast.BinOp)
        else ast.Call(node.func, parts, [])
    )
    most = 0.0
    for shifts in itertools.product((-1.0, 1.0), repeat=len(arguments)):
        moved = [a + shift * _WIDER * e for (a, e), shift in zip(arguments, shifts, strict=True)]
        try:
            most = max(most, abs(float(value_of(again, dict(zip(names, moved, strict=True)))) - value))
        except NoValue:
            continue  # the shifted argument is outside the domain of the function
    return most / _WIDER + _OF_FUNCTIONS * _UNIT * abs(value)
