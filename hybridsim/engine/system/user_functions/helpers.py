"""This module compiles the plain Python functions that a user's function calls by name."""

from __future__ import annotations

from types import CellType, FunctionType
from typing import Any

import numba

from hybridsim.engine.system.user_functions.surroundings import closure_of, globals_of

_NUMBA_KNOWS = ("numpy", "numba", "math")  # modules whose functions numba replaces


def compiled_with_helpers(function: FunctionType, made: dict[FunctionType, Any] | None = None) -> Any:
    """Return a function compiled with bounds checks, together with the plain functions that it calls.

    Bounds are checked, because finite differences and trial steps may index beyond a table.
    """
    made = {} if made is None else made
    compiled = numba.njit(error_model="numpy", boundscheck=True)
    outside = {name: value for name, value in globals_of(function).items() if _is_plain(value)}
    within = {name: value for name, value in closure_of(function).items() if _is_plain(value)}
    if not (outside or within) or function in made:
        return made.get(function) or compiled(function)
    cells = dict(zip(function.__code__.co_freevars, function.__closure__ or (), strict=True))
    surroundings = dict(function.__globals__)
    own = FunctionType(
        function.__code__,
        surroundings,
        function.__name__,
        function.__defaults__,
        tuple(CellType() if name in within else cell for name, cell in cells.items()),
    )
    made[function] = compiled(own)
    surroundings |= {name: compiled_with_helpers(helper, made) for name, helper in outside.items()}
    for name, cell in zip(cells, own.__closure__ or (), strict=True):
        if name in within:
            cell.cell_contents = compiled_with_helpers(within[name], made)
    return made[function]


def _is_plain(value: Any) -> bool:
    """Return whether a value is a plain function that has to be compiled for numba."""
    return isinstance(value, FunctionType) and (value.__module__ or "").split(".")[0] not in _NUMBA_KNOWS
