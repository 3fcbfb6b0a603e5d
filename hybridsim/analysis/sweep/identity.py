"""This module computes a text that identifies a value, such as a function by its code and its data.

The journal of an interrupted sweep may only serve the same sweep. The name of a function does not identify
it, because an edited measure, another lambda or another closure may have the same name. An object is
identified by its class and its pickled state, a class by all definitions of it and its bases. Python and
installed packages are identified by name and version.
"""

from __future__ import annotations

import copyreg
import hashlib
import sys
import sysconfig
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cached_property, partial
from operator import itemgetter
from pathlib import Path
from types import (
    BuiltinFunctionType,
    CellType,
    CodeType,
    FunctionType,
    GetSetDescriptorType,
    MemberDescriptorType,
    MethodType,
    ModuleType,
)
from typing import Any

import numpy as np

from hybridsim.errors import UsageError

_PLAIN = (type(None), bool, int, float, complex, str, bytes, type(...), type(NotImplemented), range)
_INSTALLED = {Path(sysconfig.get_path(kind)) for kind in ("purelib", "platlib")}
_EMPTY = CellType()
_NOT_READ = {"__module__", "__doc__", "__dict__", "__weakref__", "_abc_impl", "__slotnames__"} | {
    "__annotations__", "__annotate_func__", "__annotations_cache__", "__firstlineno__", "__static_attributes__"
}  # fmt: skip


def identity(value: Any) -> str:
    """Return a text that is equal for equal values, also in another process.

    Raises
    ------
    UsageError
        For an object whose state cannot be read.
    """
    return _Describer().of(value)


class _Describer:
    """Computes texts that identify values, including values that contain one another."""

    def __init__(self) -> None:
        self._around: list[int] = []  # the values in progress: a value may contain itself
        self._known: dict[int, str] = {}  # functions and classes that many others may read

    def of(self, value: Any) -> str:
        if type(value) in _PLAIN:
            return repr(value)
        if id(value) in self._around:
            return f"part of itself({self._around.index(id(value))})"
        if id(value) in self._known:
            return self._known[id(value)]
        self._around.append(id(value))
        described = self._describe(value)
        self._around.pop()
        if isinstance(value, FunctionType | type):
            described = self._known[id(value)] = hashlib.sha256(described.encode()).hexdigest()
        return described

    def _describe(self, value: Any) -> str:
        if isinstance(value, ModuleType):
            return _of_module(value.__name__)
        if isinstance(value, FunctionType | type) and _is_library(_module(value)):
            return f"{_of_module(_module(value))}.{value.__qualname__}"
        if isinstance(value, type):
            return self._class(value)
        if isinstance(value, FunctionType):
            return f"function({', '.join(map(self.of, _read_by(value)))})"
        if isinstance(value, CodeType):
            parts = (
                value.co_code,
                value.co_exceptiontable,
                value.co_names,
                value.co_varnames,
                value.co_consts,
            )
            return f"code({', '.join(map(self.of, parts))})"
        if isinstance(value, MethodType):
            return f"method({self.of(value.__func__)}, {self.of(value.__self__)})"
        if isinstance(value, GetSetDescriptorType | MemberDescriptorType):
            return value.__qualname__
        return self._data(value)

    def _data(self, value: Any) -> str:
        if type(value) is np.ndarray and not value.dtype.hasobject:
            return f"array({value.dtype!r}, {value.shape}, {hashlib.sha256(value.tobytes()).hexdigest()})"
        if type(value) is np.ndarray:
            return f"array({value.shape}, {self.of(value.ravel().tolist())})"
        if isinstance(value, np.generic) and type(value.item()) in _PLAIN:
            return self.of(value.item())
        if isinstance(value, Mapping) and _is_library(_module(type(value))):
            keys = sorted(((self.of(key), key) for key in value), key=itemgetter(0))
            return f"{{{', '.join(f'{described}: {self.of(value[key])}' for described, key in keys)}}}"
        if type(value) in (list, tuple):
            return f"({', '.join(map(self.of, value))})"
        if type(value) in (set, frozenset):
            return f"{{{', '.join(sorted(map(self.of, value)))}}}"
        return f"{self.of(type(value))}({self._state(value)})"

    def _class(self, value: type) -> str:
        """Return the identity of a class, from all definitions of the class and its bases."""
        defined = {name: part for name, part in vars(value).items() if name not in _NOT_READ}
        parts = (value.__qualname__, type(value), value.__bases__, defined)
        return f"class({', '.join(map(self.of, parts))})"

    def _state(self, value: Any) -> str:
        if isinstance(value, partial):
            return self.of((value.func, value.args, value.keywords))
        if isinstance(value, staticmethod | classmethod):
            return self.of(value.__func__)
        if isinstance(value, property):
            return self.of((value.fget, value.fset, value.fdel))
        if isinstance(value, cached_property):
            return self.of(value.func)
        if isinstance(getattr(value, "__wrapped__", None), FunctionType):  # compiled, or with a cache
            return self.of(value.__wrapped__)
        if is_dataclass(value) and _is_library(_module(type(value))):
            return self.of({field.name: getattr(value, field.name) for field in fields(value)})
        if isinstance(value, BuiltinFunctionType) and isinstance(value.__self__, ModuleType | type(None)):
            return f"{value.__module__}.{value.__qualname__}"
        try:
            reduce = copyreg.dispatch_table.get(type(value))
            state = value.__reduce_ex__(4) if reduce is None else reduce(value)
        except Exception as error:  # a user's class may raise anything, and then it cannot be identified
            raise UsageError(
                f"the measure uses an object of type {type(value).__qualname__}, which cannot be identified in a "
                f"journal: {error}",
                remedy="run the sweep without a journal, or give the class a method __getstate__ that returns its "
                "content",
            ) from error
        if isinstance(state, str):
            return f"{_of_module(_module(value))}.{state}"
        made, arguments, *rest = state
        held, items, pairs = (*rest, None, None, None)[:3]
        return self.of((made, arguments, held, list(items or ()), dict(pairs or ())))


def _module(value: Any) -> str:
    """Return the module of a class or function; some objects not written in Python have no module."""
    name = getattr(value, "__module__", None)
    return name if isinstance(name, str) else "builtins"


def _is_library(name: str) -> bool:
    """Return whether a module belongs to Python, an installed package, or this package."""
    top = name.partition(".")[0]
    if top in sys.stdlib_module_names or top == __name__.partition(".")[0]:
        return True
    file = getattr(sys.modules.get(name), "__file__", None)
    return file is not None and not _INSTALLED.isdisjoint(Path(file).parents)


def _of_module(name: str) -> str:
    """Return the identity of a module: the version of a library, or a hash of any other module's file."""
    module = sys.modules.get(name)
    if _is_library(name) or not (file := getattr(module, "__file__", None)) or not Path(file).is_file():
        return f"{name} {getattr(sys.modules.get(name.partition('.')[0]), '__version__', '')}"
    return f"{name} {hashlib.sha256(Path(file).read_bytes()).hexdigest()}"


def _read_by(function: FunctionType) -> list[Any]:
    """Return the values that a function reads in addition to its arguments."""
    code = function.__code__
    cells = [cell.cell_contents for cell in function.__closure__ or () if cell != _EMPTY]
    found = {n: function.__globals__[n] for n in sorted(_names(code)) if n in function.__globals__}
    return [code, function.__defaults__, function.__kwdefaults__, cells, vars(function), found]


def _names(code: CodeType) -> set[str]:
    """Return the names that a code object uses, including names in nested code."""
    inner = (part for part in code.co_consts if isinstance(part, CodeType))
    return set(code.co_names).union(*map(_names, inner))
