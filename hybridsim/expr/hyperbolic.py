"""Hyperbolic functions of real arguments, which avoid a slow expansion in SymPy.

All names and operations of expressions are real where they are defined. SymPy cannot infer this for roots or arc sines,
whose arguments may be outside the domain. To decide whether tanh of such a term is real, SymPy expands the term into
real and imaginary parts, which takes minutes in every step of a differentiation.
"""

from __future__ import annotations

from typing import Any

import sympy
from sympy.core.function import ArgumentIndexError


class sinh(sympy.sinh):  # SymPy's printers use the name of the class
    """The hyperbolic sine of a real argument."""

    is_real = True

    def fdiff(self, argindex: int = 1) -> Any:
        """Return the derivative cosh(u)."""
        return cosh(_only(self, argindex))


class cosh(sympy.cosh):
    """The hyperbolic cosine of a real argument."""

    is_positive = True

    def fdiff(self, argindex: int = 1) -> Any:
        """Return the derivative sinh(u)."""
        return sinh(_only(self, argindex))


class tanh(sympy.tanh):
    """The hyperbolic tangent of a real argument."""

    is_real = True

    def fdiff(self, argindex: int = 1) -> Any:
        """Return the derivative 1 - tanh(u)**2."""
        return 1 - tanh(_only(self, argindex)) ** 2


def _only(function: Any, argindex: int) -> Any:
    """Return the only argument of a function, for use in its derivative."""
    if argindex != 1:
        raise ArgumentIndexError(function, argindex)
    return function.args[0]
