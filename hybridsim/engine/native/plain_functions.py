"""Functions of a model without a compiler: they compute as compiled code does, also where Python raises an error."""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType
from typing import Any

import numpy as np

_FAULTS = (ZeroDivisionError, ValueError, OverflowError)


def as_compiled(function: FunctionType) -> Callable[[float, Any, Any, Any, Any], int]:
    """Return a function in which a fault makes a number infinite or NaN, and all numbers only as a last resort.

    Python raises an error for 0.0/0.0. NumPy's numbers give NaN, which compiled code may not use at all: a force that
    is undetermined, for example, does not matter for states that are held.
    """
    constants = tuple(np.float64(c) if isinstance(c, float) else c for c in function.__code__.co_consts)
    with_numpy = FunctionType(function.__code__.replace(co_consts=constants), function.__globals__)

    def guarded(t: float, x: Any, p: Any, z: Any, out: Any) -> int:
        for one in (function, with_numpy):
            try:
                return int(one(t, x, p, z, out))
            except _FAULTS:
                continue
        out[:] = np.nan
        return 1

    return guarded
