"""Convert a checked expression to SymPy."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping
from typing import Any

import sympy
from sympy.printing.pycode import PythonCodePrinter

from hybridsim.expr import hyperbolic
from hybridsim.expr.parse import Expression, require_names


def _absolute(u: Any) -> Any:
    """Return |u| without SymPy's split into real and imaginary parts."""
    return sympy.Abs(u) if u.is_extended_real else sympy.Max(u, -u)


class exp(sympy.exp):  # SymPy's printers use the name of the class
    """The exponential of a sum without SymPy's split into a product, whose factors may overflow."""

    def __new__(cls, arg: Any, **options: Any) -> Any:
        """Create the exponential of an argument; sums are not simplified."""
        return super().__new__(cls, arg, **(options | {"evaluate": False} if arg.is_Add else options))

    def as_base_exp(self) -> tuple[Any, Any]:
        """Return the exponential itself as base, so that SymPy merges it only with equal factors."""
        return self, sympy.Integer(1)

    def _eval_power(self, other: Any) -> Any:
        return self.func(self.args[0] * other) if other.is_real else None


class floor(sympy.Function):
    """The largest whole number at or below an argument; its derivative is zero."""

    @classmethod
    def eval(cls, arg: Any) -> Any:
        """Return the value at a number, or None."""
        return sympy.floor(arg) if arg.is_Number else None

    def fdiff(self, argindex: int = 1) -> Any:
        """Return the derivative, zero."""
        return sympy.Integer(0)

    def _eval_is_extended_real(self) -> Any:
        return self.args[0].is_extended_real


_FUNCTIONS: dict[str, Any] = {
    "sin": sympy.sin,
    "cos": sympy.cos,
    "tan": sympy.tan,
    "asin": sympy.asin,
    "acos": sympy.acos,
    "atan": sympy.atan,
    "atan2": sympy.atan2,
    "sinh": hyperbolic.sinh,
    "cosh": hyperbolic.cosh,
    "tanh": hyperbolic.tanh,
    "exp": exp,
    "log": sympy.log,
    "sqrt": sympy.sqrt,
    "abs": _absolute,
    "sign": sympy.sign,
    "min": sympy.Min,
    "max": sympy.Max,
    "floor": floor,
    "mod": lambda x, d: x - d * floor(x / d),
    "round": lambda x: floor(x + sympy.Rational(1, 2)),
}
_RELATIONS: dict[type[ast.cmpop], Any] = {
    ast.Lt: sympy.Lt,
    ast.LtE: sympy.Le,
    ast.Gt: sympy.Gt,
    ast.GtE: sympy.Ge,
    ast.Eq: sympy.Eq,
    ast.NotEq: sympy.Ne,
}


def to_sympy(expr: Expression, symbols: Mapping[str, Any]) -> Any:
    """Convert an expression to SymPy (an Expr, or a Boolean for a condition).

    Integers are exact, and decimal numbers have the 53 bits of their double. A conditional becomes a Piecewise;
    abs, min, max and sign are kept.

    Parameters
    ----------
    symbols : a SymPy object, usually a real symbol, for every name of the expression, including ``t``.

    Raises
    ------
    ExpressionError
        For a name without a symbol, or a comparison of complex values.
    """
    require_names(expr, symbols)
    try:
        return _convert(expr.tree, symbols)
    except (TypeError, ValueError, OverflowError) as fault:
        raise expr.error(
            f"'{expr.text}' has no symbolic form: {fault}", remedy="write the expression in another form"
        ) from None


def derivative(e: Any, symbol: Any) -> Any:
    """Return de/d(symbol); at a corner of abs, min or max, return the derivative from the right."""
    return without_distributions(sympy.diff(e, symbol))


def without_distributions(e: Any) -> Any:
    """Replace the delta and step functions in SymPy's derivatives of corners and jumps."""
    if not e.has(sympy.DiracDelta, sympy.Heaviside):
        return e
    plain = e.replace(sympy.DiracDelta, lambda *_: sympy.Integer(0))
    return plain.replace(sympy.Heaviside, lambda a, *_: sympy.Piecewise((1, a >= 0), (0, True)))


def _convert(node: ast.expr, symbols: Mapping[str, Any]) -> Any:
    match node:
        case ast.Constant(value=bool() as truth):
            return sympy.true if truth else sympy.false
        case ast.Constant(value=int() as number):
            return sympy.Integer(number)
        case ast.Constant(value=float() as number):
            return sympy.Float(number, precision=53)
        case ast.Name(id="pi"):
            return sympy.pi
        case ast.Name(id=name):
            return symbols[name]
        case ast.UnaryOp(op=op, operand=operand):
            value = _convert(operand, symbols)
            return (
                sympy.Not(value) if isinstance(op, ast.Not) else -value if isinstance(op, ast.USub) else value
            )
        case ast.BinOp(left=left, op=op, right=right):
            return _binary(op, _convert(left, symbols), _convert(right, symbols))
        case ast.BoolOp(op=op, values=values):
            parts = [_convert(value, symbols) for value in values]
            return sympy.And(*parts) if isinstance(op, ast.And) else sympy.Or(*parts)
        case ast.Compare(left=left, ops=ops, comparators=others):
            terms = [_convert(part, symbols) for part in (left, *others)]
            pairs = zip(ops, terms[:-1], terms[1:], strict=True)
            return sympy.And(*(_RELATIONS[type(op)](a, b) for op, a, b in pairs))
        case ast.IfExp(test=test, body=body, orelse=orelse):
            condition, first, second = (_convert(part, symbols) for part in (test, body, orelse))
            if first.is_Boolean or second.is_Boolean:
                return sympy.ITE(condition, first, second)
            return sympy.Piecewise((first, condition), (second, True))
        case ast.Call(func=ast.Name(id=name), args=args):
            return _FUNCTIONS[name](*(_convert(arg, symbols) for arg in args))
    raise TypeError(f"a checked expression cannot contain {ast.dump(node)}")


def _binary(op: ast.operator, left: Any, right: Any) -> Any:
    match op:
        case ast.Add():
            return left + right
        case ast.Sub():
            return left - right
        case ast.Mult():
            return left * right
        case ast.Div():
            return left / right
    if right.is_Float and float(right).is_integer():
        right = sympy.Integer(int(right))  # x**2.0 differentiates like x**2
    if left.is_Rational and right.is_Rational and not (left.is_Integer and right.is_Integer and right >= 0):
        # exact powers of fractions could become arbitrarily long
        return sympy.Float(float(left) ** float(right), precision=53)
    return left**right


class PythonPrinter(PythonCodePrinter):
    """Prints SymPy expressions as plain Python, with all digits of numbers."""

    def __init__(self) -> None:
        super().__init__({"fully_qualified_modules": False, "standard": "python3"})

    def _print_Float(self, e: Any) -> str:
        return repr(float(e))


class ModulePrinter(PythonPrinter):
    """Prints SymPy expressions as plain Python, with all digits, and with powers that stay real."""

    def _print_Integer(self, e: Any) -> str:
        return f"{e.p}.0"

    def _print_Rational(self, e: Any) -> str:
        return f"({e.p}.0/{e.q}.0)"

    def _print_Pow(self, e: Any, rational: bool = False) -> str:
        base = self.parenthesize(e.base, 100)
        if e.exp.is_Integer and abs(int(e.exp)) <= 64:
            n = int(e.exp)
            return f"{base}**{n}" if n > 0 else f"1.0/{base}**{-n}" if n < -1 else f"1.0/{base}"
        if e.exp in (sympy.Rational(1, 2), 0.5):
            return f"sqrt({self._print(e.base)})"
        return f"pow({self._print(e.base)}, {self._print(e.exp)})"

    def _print_Exp1(self, e: Any) -> str:
        return repr(math.e)

    def _print_sign(self, e: Any) -> str:
        a = self._print(e.args[0])
        return f"(0.0 if ({a}) == 0.0 else copysign(1.0, {a}))"

    def _print_Min(self, e: Any) -> str:
        return self._fold("min", e)

    def _print_Max(self, e: Any) -> str:
        return self._fold("max", e)

    def _fold(self, name: str, e: Any) -> str:
        text = self._print(e.args[0])
        for a in e.args[1:]:
            text = f"{name}({text}, {self._print(a)})"
        return text

    def _print_Piecewise(self, e: Any) -> str:
        text = self._print(e.args[-1].expr)
        for pair in reversed(e.args[:-1]):
            text = f"(({self._print(pair.expr)}) if {self._print(pair.cond)} else ({text}))"
        return text
