"""What Python functions read besides their arguments, as it is now: compiled code keeps what it was."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from types import CodeType, FunctionType
from typing import Any

import numpy as np

_PLAIN = (bool, int, float, complex, str, bytes, type(None), np.generic)


def surroundings(functions: Iterable[Callable[..., Any]]) -> tuple[Any, ...]:
    """Names and values of the globals and closures of plain functions.

    Numbers and texts, tuples and arrays of them, by what they say; everything else by which object it is. What numba
    has been told to compile already (`numba.njit`) keeps what it read then, as numba has it.
    """
    return tuple(_surroundings(functions, []))


def _surroundings(
    functions: Iterable[Callable[..., Any]], seen: list[FunctionType]
) -> Iterator[tuple[Any, ...]]:
    for function in functions:
        if isinstance(function, FunctionType) and function not in seen:
            seen.append(function)
            for name, value in read(function):
                yield name, _told(value)
                yield from _surroundings([value], seen)  # what a plain function that it calls reads


def read(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """Names and values of its globals and of its closure."""
    for name in sorted(_names(function.__code__)):
        if name in function.__globals__:
            yield name, function.__globals__[name]
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        try:
            yield name, cell.cell_contents
        except ValueError:  # nothing has been put into it so far
            continue


def _names(code: CodeType) -> set[str]:
    inner = [_names(constant) for constant in code.co_consts if isinstance(constant, CodeType)]
    return set(code.co_names).union(*inner)


def _told(value: Any) -> Any:
    if isinstance(value, _PLAIN):
        return type(value), repr(value)
    if isinstance(value, tuple):
        return tuple(map(_told, value))
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    return id(value)
