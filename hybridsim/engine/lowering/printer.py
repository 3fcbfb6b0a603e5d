"""This module prints SymPy expressions as Python text for generated modules."""

from __future__ import annotations

import math
from typing import Any

from sympy import Rational

from hybridsim.expr.symbolic import PythonPrinter


class Printer(PythonPrinter):
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
        if e.exp in (Rational(1, 2), 0.5):
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
