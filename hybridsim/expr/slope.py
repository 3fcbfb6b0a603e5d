"""This module differentiates an expression with respect to a name."""

from __future__ import annotations

from typing import Any

from hybridsim.expr.parse import Expression, parse


def slope(expr: Expression, name: str) -> Expression:
    """Return the partial derivative d(expr)/d(name).

    Raises
    ------
    ExpressionError
        If the derivative cannot be written with the functions of expressions.
    """
    if name not in expr.names:
        return parse(0, expr.place)
    import sympy

    from hybridsim.expr.symbolic import derivative, to_sympy

    symbols = {n: sympy.Symbol(n, real=True) for n in expr.names}
    found = derivative(to_sympy(expr, symbols), symbols[name])
    return parse(_printer().doprint(found), expr.place)


def _printer() -> Any:
    from hybridsim.expr.symbolic import PythonPrinter

    class Printer(PythonPrinter):
        """Prints SymPy expressions with the function names of expressions and with all digits."""

        def _print_sign(self, e: Any) -> str:
            return f"sign({self._print(e.args[0])})"

        def _print_Exp1(self, e: Any) -> str:
            return "exp(1)"

    return Printer()
