"""This module collects the globals and closures that functions read, to detect changes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

_PLAIN = (bool, int, float, complex, str, bytes, type(None), np.generic)


def surroundings(functions: Iterable[Callable[..., Any]]) -> tuple[Any, ...]:
    """Return the names and values of the globals and closures of plain functions.

    Numbers, texts, tuples and arrays are compared by value, everything else by identity. Functions already compiled by
    `numba.njit` keep the values they read then, as in numba itself.
    """
    return tuple(_surroundings(functions, []))


def _surroundings(
    functions: Iterable[Callable[..., Any]], seen: list[FunctionType]
) -> Iterator[tuple[Any, ...]]:
    for function in functions:
        if isinstance(function, FunctionType) and function not in seen:
            seen.append(function)
            yield (
                "defaults",
                _fingerprint((function.__defaults__, tuple((function.__kwdefaults__ or {}).items()))),
            )
            for name, value in (*globals_of(function).items(), *closure_of(function).items()):
                yield name, _fingerprint(value)
                if isinstance(value, ModuleType):  # attributes of a module that the function may read
                    for part in sorted(_names(function.__code__) & vars(value).keys()):
                        yield f"{name}.{part}", _fingerprint(vars(value)[part])
                yield from _surroundings([value], seen)  # values read by plain functions that it calls


def globals_of(function: FunctionType) -> dict[str, Any]:
    """Return the names and values of the globals that a function may read."""
    known = function.__globals__
    return {name: known[name] for name in sorted(_names(function.__code__)) if name in known}


def closure_of(function: FunctionType) -> dict[str, Any]:
    """Return the names and values of a function's closure, without empty cells."""
    found = {}
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        try:
            found[name] = cell.cell_contents
        except ValueError:
            continue
    return found


def _names(code: CodeType) -> set[str]:
    inner = [_names(constant) for constant in code.co_consts if isinstance(constant, CodeType)]
    return set(code.co_names).union(*inner)


def _fingerprint(value: Any) -> Any:
    if isinstance(value, _PLAIN):
        return type(value), repr(value)
    if isinstance(value, tuple):
        return tuple(map(_fingerprint, value))
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    return id(value)
