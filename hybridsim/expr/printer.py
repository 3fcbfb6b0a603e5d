"""This module prints SymPy expressions as plain Python."""

from __future__ import annotations

from typing import Any

from sympy.printing.pycode import PythonCodePrinter


class PythonPrinter(PythonCodePrinter):  # type: ignore[misc]  # SymPy has no types
    """Prints SymPy expressions as plain Python, with all digits of numbers."""

    def __init__(self) -> None:
        super().__init__({"fully_qualified_modules": False, "standard": "python3"})

    def _print_Float(self, e: Any) -> str:
        return repr(float(e))
