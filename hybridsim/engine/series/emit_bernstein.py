"""This module writes code that converts power series of a few degrees to Bernstein form.

The sums equal those of `to_bernstein` in `hybridsim.engine.roots.first_exit` to the last bit, without the
loops.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from hybridsim.engine.native.cache import model_folder
from hybridsim.engine.native.llvm_text import Lines, function, number
from hybridsim.engine.native.model_functions import compile_series

LEADING = 4  # number of cases for the count of leading coefficients set to zero


@cache
def bernstein_code(order: int) -> tuple[list[int], Any]:
    """Return the addresses of conversion functions, and an object that keeps them alive.

    There is one function per count of omitted leading coefficients. The functions are void f(., ., a, ., .,
    b), as for series: a are the power coefficients, b the Bernstein coefficients.
    """
    names = [f"bernstein_{size}" for size in range(order + 1, order + 1 - LEADING, -1)]
    folder = model_folder()
    path = None if folder is None else folder / f"bernstein{order}"
    return compile_series(path, names, lambda: bernstein_text(order))


def bernstein_text(order: int) -> str:
    """Return the text of a module with the conversion functions."""
    sizes = range(order + 1, order + 1 - LEADING, -1)
    return "".join(_function(f"bernstein_{size}", size) for size in sizes)


def _function(name: str, size: int) -> str:
    code, n, share = Lines(), size - 1, 1.0
    b = [code.load("%x", 0)]
    for k in range(1, size):
        share *= k / (n - k + 1.0)
        b.append(code.op("fmul", code.load("%x", k), number(share)))
    for k in range(1, size):
        for j in range(n, k - 1, -1):
            b[j] = code.op("fadd", b[j], b[j - 1])
    for j in range(size):
        code.store(b[j], "%out", j)
    return function(name, code.lines)
