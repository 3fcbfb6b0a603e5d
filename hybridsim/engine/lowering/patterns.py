"""This module replaces the names in an expression by numbers, so that copies of a part share symbolic results."""

from __future__ import annotations

from collections.abc import Container
from typing import Any

from sympy import Symbol


def pattern_of(e: Any, moving: Container[Any] = ()) -> tuple[Any, dict[Any, Any]]:
    """Return an expression with numbered names, and the numbered name of each symbol.

    The numbers are in the order of the names, on which the order of terms depends. moving : symbols that get another
    kind of name.
    """
    numbered = {
        s: Symbol(f"{'moving' if s in moving else 'fixed'}_{i:04d}", real=True)
        for i, s in enumerate(sorted(e.free_symbols, key=str))
    }
    return e.xreplace(numbered), numbered
