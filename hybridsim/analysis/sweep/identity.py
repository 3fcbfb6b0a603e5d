"""What tells one value from another, in a text: of a function its code and all that it reads, of an array its bytes.

A file of a sweep that was interrupted serves the sweep that it was begun for. A function's name does not tell it: an
edited measure, another lambda or another closure may have the same.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from inspect import getattr_static
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np


def identity(value: Any, seen: tuple[int, ...] = ()) -> str:
    """A text that is the same for what is the same, also in another process; seen: what this is a part of."""
    if id(value) in seen:
        return "itself"
    seen = (*seen, id(value))

    def of(part: Any) -> str:
        return identity(part, seen)

    if isinstance(value, np.ndarray):
        if value.dtype.hasobject:
            return f"array({value.shape}, {of(value.ravel().tolist())})"
        return f"array({value.dtype.str}, {value.shape}, {hashlib.sha256(value.tobytes()).hexdigest()})"
    if isinstance(value, np.generic):
        return of(value.item())
    if isinstance(value, Mapping):
        return f"{{{', '.join(sorted(f'{of(k)}: {of(v)}' for k, v in value.items()))}}}"
    if isinstance(value, list | tuple):
        return f"({', '.join(map(of, value))})"
    if isinstance(value, set | frozenset):
        return f"{{{', '.join(sorted(map(of, value)))}}}"
    if is_dataclass(value) and not isinstance(value, type):
        parts = {field.name: getattr(value, field.name) for field in fields(value)}
        return f"{type(value).__qualname__}{of(parts)}"
    if isinstance(value, partial):
        return f"partial({of(value.func)}, {of(value.args)}, {of(value.keywords)})"
    if isinstance(value, MethodType):
        return f"method({of(value.__func__)}, {of(value.__self__)})"
    if isinstance(value, FunctionType):
        return f"function({', '.join(map(of, _read_by(value)))})"
    if isinstance(value, CodeType):
        return f"code({value.co_code.hex()}, {of(value.co_names)}, {of(value.co_consts)})"
    if isinstance(value, ModuleType):
        return value.__name__
    if hasattr(value, "__qualname__"):  # of classes, and of functions that are not written in Python
        return f"{value.__module__}.{value.__qualname__}"
    text = repr(value)
    if f" at {id(value):#x}" not in text:
        return text
    call = getattr_static(type(value), "__call__", None) if callable(value) else None
    return f"{of(type(value))}({of(getattr(value, '__dict__', None))}, {of(call)})"


def _read_by(function: FunctionType) -> list[Any]:
    """What the result of a function depends on beside its arguments; functions of other files by their names."""
    code = function.__code__
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    found = {name: function.__globals__[name] for name in _names(code) if name in function.__globals__}
    for name, value in found.items():
        if isinstance(value, FunctionType) and value.__module__ != function.__module__:
            found[name] = f"{value.__module__}.{value.__qualname__}"
    return [code, function.__defaults__, function.__kwdefaults__, cells, found]


def _names(code: CodeType) -> set[str]:
    """Names that a code and those within it look up."""
    inner = (part for part in code.co_consts if isinstance(part, CodeType))
    return set(code.co_names).union(*map(_names, inner))
