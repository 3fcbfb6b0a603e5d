"""This module compiles the functions of a model, and evaluates them at one or many points.

A model function has one signature, ``f(t, x, p, z, out) -> status``. With the compiler on it is a C function
reached through its address, so that a kernel is compiled once and never per model. With ``HYBRIDSIM_JIT=0``
the "address" is the Python function itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np

from hybridsim.engine.native.compiler import ENABLED
from hybridsim.engine.native.kernels import call, kernel


def as_compiled(function: FunctionType) -> Callable[[float, Any, Any, Any, Any], int]:
    """Return a Python function in which 0.0/0.0 is NaN, as in compiled code."""
    numbers = tuple(np.float64(c) if isinstance(c, float) else c for c in function.__code__.co_consts)
    with_numpy = FunctionType(function.__code__.replace(co_consts=numbers), function.__globals__)

    def guarded(*arguments: Any) -> int:
        for one in (function, with_numpy):
            with suppress(ArithmeticError, ValueError):
                return int(one(*arguments))
        arguments[-1][:] = np.nan
        return 1

    return guarded


if ENABLED:
    from numba import types

    from hybridsim.engine.native.llvm import (
        compile_text,
        definition_in,
        functions_in,
        load_or_compile,
        machine_name,
    )

    _DOUBLES = types.CPointer(types.float64)
    _LONGS = types.CPointer(types.int64)
    SIGNATURE = types.int32(types.float64, _DOUBLES, _DOUBLES, _LONGS, _DOUBLES)

    def compile_model_function(module: Any, name: str) -> tuple[Any, Any]:
        """Compile one function of a generated module; return its address and an object that keeps it alive."""
        path = getattr(module, "__file__", None)  # None for a module that exists only in memory
        stored = None if path is None else _of_this_machine(Path(path).with_suffix(f".{name}"))
        return compile_text(module.__loader__.get_source(module.__name__), name, stored)

    def texts_to_compile(module: Any) -> list[str]:
        """Return the source of the functions of a generated module that have no cached machine code."""
        path, text = getattr(module, "__file__", None), module.__loader__.get_source(module.__name__)
        return [
            definition_in(text, name)
            for name in functions_in(text)
            if path is None or not is_stored(Path(path).with_suffix(f".{name}"))
        ]

    def compile_series(
        stored: Path | None, names: Sequence[str], written: Callable[[], str]
    ) -> tuple[list[int], Any]:
        """Return the addresses of series functions for `call_series`, and an object that keeps them alive."""
        return load_or_compile(None if stored is None else _of_this_machine(stored), names, written)

    def is_stored(stored: Path | None) -> bool:
        """Return whether the compiled series functions are cached."""
        return stored is not None and _of_this_machine(stored).exists()

    def _of_this_machine(stored: Path) -> Path:
        return stored.with_name(f"{stored.name}.{machine_name()}.o")

else:

    def compile_model_function(module: Any, name: str) -> tuple[Any, Any]:
        """Wrap a model function in Python so that it gives the same results as compiled code."""
        return (as_compiled(getattr(module, name)),) * 2

    def texts_to_compile(module: Any) -> list[str]:
        """Return an empty list, because nothing is compiled."""
        return []

    def compile_series(
        stored: Path | None, names: Sequence[str], written: Callable[[], str]
    ) -> tuple[list[int], Any]:
        """Raise NotImplementedError; the translation requires the compiler, which is off."""
        raise NotImplementedError

    def is_stored(stored: Path | None) -> bool:
        """Return False, because nothing is cached."""
        return False


@kernel
def evaluate(function: Any, t: float, x: Any, p: Any, z: Any, out: Any) -> None:
    """Evaluate a model function once and write the result to `out`."""
    call(function, t, x, p, z, out)


@kernel
def evaluate_rows(function: Any, times: Any, states: Any, p: Any, z: Any, out: Any) -> None:
    """Evaluate out[k] = function(times[k], states[k]) for every row k."""
    for k in range(times.shape[0]):
        call(function, times[k], states[k], p, z, out[k])
