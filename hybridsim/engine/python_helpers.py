"""Plain Python functions that a user's function calls by name, compiled along with it: numba takes no others."""

from __future__ import annotations

from types import CellType, FunctionType
from typing import Any

import numba

from hybridsim.engine.python_surroundings import read

_NUMBA_KNOWS = ("numpy", "numba", "math")  # modules whose functions it replaces by its own


def compiled_with_helpers(function: FunctionType, made: dict[FunctionType, Any] | None = None) -> Any:
    """A function for numba, with bounds checked; globals and closures that are plain functions are compiled likewise.

    Bounds are checked since differences and trial steps go where an index into a table may be beyond it.
    """
    made = {} if made is None else made
    compiled = numba.njit(error_model="numpy", boundscheck=True)
    helpers = {
        name: value
        for name, value in read(function)
        if isinstance(value, FunctionType) and value.__module__.split(".")[0] not in _NUMBA_KNOWS
    }
    if not helpers or function in made:
        return made.get(function) or compiled(function)
    surroundings = dict(function.__globals__)
    cells = dict(zip(function.__code__.co_freevars, function.__closure__ or (), strict=True))
    own = FunctionType(
        function.__code__,
        surroundings,
        function.__name__,
        function.__defaults__,
        tuple(CellType() if name in helpers else cell for name, cell in cells.items()),
    )
    made[function] = compiled(own)
    for name, helper in helpers.items():
        ready = compiled_with_helpers(helper, made)
        if name in cells:
            own.__closure__[list(cells).index(name)].cell_contents = ready  # type: ignore[index]  # it has cells
        else:
            surroundings[name] = ready
    return made[function]
