"""This module loads the generated module of a model from disk, or generates it."""

from __future__ import annotations

import hashlib
import importlib.util
import time
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.abc import InspectLoader
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from hybridsim.engine.native.cache import model_folder, store
from hybridsim.engine.native.private_folder import is_trusted_file
from hybridsim.forks import SharedLock

if TYPE_CHECKING:
    from hybridsim.engine.system.user_functions.code import PythonCode
    from hybridsim.model.parts.model import Model


@dataclass(frozen=True)
class Compiled:
    """The functions of a model: compiled functions for kernels, and Python functions for events."""

    module: ModuleType
    seconds: float  # time of lowering; 0 if the module was cached
    _compiled: dict[str, tuple[Any, Any]] = field(default_factory=dict)
    shared: dict[Any, Any] = field(default_factory=dict)  # of `hybridsim.engine.system.per_structure`

    is_current = True  # expressions depend on nothing outside the model

    @property
    def data(self) -> dict[str, Any]:
        """Return all data of the generated module that are not functions."""
        return self.module.DATA

    def lengths_to_compile(self) -> list[int]:
        """Return the lengths of the source texts that are not compiled yet."""
        from hybridsim.engine.native.model_functions import texts_to_compile

        return [len(text) for text in texts_to_compile(self.module)]

    def address(self, name: str) -> Any:
        """Return the address of a compiled function by its name, such as flow or guards."""
        if name not in self._compiled:
            from hybridsim.engine.native.model_functions import compile_model_function

            # another thread may have been first; its code is in use and must be kept
            self._compiled.setdefault(name, compile_model_function(self.module, name))
        return self._compiled[name][0]


_loaded: dict[str, Compiled] = {}
_STRUCTURES = 64  # most recently used modules kept in memory; others are read from disk again
_MAX_FUNCTION_MODELS = 16  # models of Python functions kept in memory; these are not stored on disk
_of_functions: dict[tuple[Any, ...], PythonCode] = {}
_lock = SharedLock()  # for both dictionaries


def compiled(model: Model) -> Compiled | PythonCode:
    """Return the compiled form of a model from memory or disk, or by lowering the model."""
    if model.flow is not None:
        return _code_of_functions(model)
    name: str = model.once("module", lambda: _name(model))
    code = _loaded.get(name) or _load(model, name)
    with _lock:
        # another thread may have been first; its module is in use
        code = _loaded.pop(name, code)
        _loaded[name] = code
        while len(_loaded) > _STRUCTURES:
            del _loaded[next(iter(_loaded))]
    return code


def _code_of_functions(model: Model) -> PythonCode:
    from hybridsim.engine.system.user_functions.code import PythonCode

    # copies with other parameter values have the same functions
    key = (model.structure(), model.flow, model.components, model.monitors, model.schedules, model.outputs)
    with _lock:
        if key in _of_functions and not _of_functions[key].is_current:
            del _of_functions[key]
        code = _of_functions.pop(key, None) or PythonCode(model)
        while len(_of_functions) >= _MAX_FUNCTION_MODELS:
            del _of_functions[next(iter(_of_functions))]
        _of_functions[key] = code
        return code


def _name(model: Model) -> str:
    return f"hybridsim_model_{hashlib.sha256(model.structure().encode()).hexdigest()[:24]}"


def _path(name: str) -> Path | None:
    folder = model_folder()
    return None if folder is None else folder / f"{name}.py"


def _load(model: Model, name: str) -> Compiled:
    path = _path(name)
    if path is not None and path.exists():
        # A damaged file may raise any exception. If a new copy of it raises as well, the model is at fault.
        with suppress(Exception):
            return Compiled(_import(_FromDisk(name, str(path))), 0.0)
    from hybridsim.engine.lowering.emit import emit

    start = time.perf_counter()
    text = emit(model)
    is_stored = store(path, text.encode())
    seconds = time.perf_counter() - start
    loader = _FromDisk(name, str(path)) if is_stored else _FromMemory(name, text)
    return Compiled(_import(loader), seconds)


class _FromDisk(SourceFileLoader):
    """Loads modules only from files that no other user can have written."""

    def get_data(self, path: str) -> bytes:
        """Return the bytes of a file."""
        if not is_trusted_file(path):
            raise PermissionError(f"{path} may belong to another user")
        return super().get_data(path)


class _FromMemory(InspectLoader):
    """Loads the module of a model from its text if nothing is stored on disk."""

    def __init__(self, name: str, text: str) -> None:
        self.name, self._text = name, text

    def get_source(self, fullname: str) -> str:
        """Return the source text of the module."""
        return self._text


def module_of(name: str, text: str) -> ModuleType:
    """Return a module with the given text."""
    return _import(_FromMemory(name, f"DATA = {{}}\n{text}"))


def _import(loader: _FromDisk | _FromMemory) -> ModuleType:
    spec = importlib.util.spec_from_loader(loader.name, loader)
    assert spec is not None, "it has a loader"
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    if not hasattr(module, "DATA"):
        raise ImportError(f"{loader.name} is incomplete")
    return module
