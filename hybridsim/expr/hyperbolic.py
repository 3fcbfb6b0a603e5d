"""Hyperbolic functions of what is real: SymPy's own expand their argument to find out whether it is.

A name has a real value, and so has each operation of an expression wherever it has one at all. SymPy does not know that
of a root or an arc sine, whose argument may be beyond its domain, and whether tanh of one is real it asks its real and
its imaginary part, after products of sums are expanded and roots of them are taken apart: for minutes, in every step of
a differentiation.
"""

from __future__ import annotations

from typing import Any

import sympy
from sympy.core.function import ArgumentIndexError


class sinh(sympy.sinh):  # named as what SymPy's printers know
    """sinh(u) of a real u."""

    is_real = True

    def fdiff(self, argindex: int = 1) -> Any:
        """cosh(u)."""
        return cosh(_only(self, argindex))


class cosh(sympy.cosh):
    """cosh(u) of a real u."""

    is_positive = True

    def fdiff(self, argindex: int = 1) -> Any:
        """sinh(u)."""
        return sinh(_only(self, argindex))


class tanh(sympy.tanh):
    """tanh(u) of a real u."""

    is_real = True

    def fdiff(self, argindex: int = 1) -> Any:
        """1 - tanh(u)**2."""
        return 1 - tanh(_only(self, argindex)) ** 2


def _only(function: Any, argindex: int) -> Any:
    """The argument by which a function is differentiated: it has one."""
    if argindex != 1:
        raise ArgumentIndexError(function, argindex)
    return function.args[0]
