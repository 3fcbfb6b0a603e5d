"""This module lists the undocumented parts of numba and llvmlite that kernels use.

A later version may rename or drop them. Each is looked up here, and nowhere else. Without one of `_NEEDED` the engine
runs as plain Python, as with ``HYBRIDSIM_JIT=0``. Without one of the others compiling takes longer or more often. One
line on stderr says so.
"""

from __future__ import annotations

import importlib
import sys
from functools import cache
from typing import Any

# What compiled kernels consist of: module, name, and what it is for.
_NEEDED = (
    ("numba.core", "cgutils"),  # loads the entries of tuples, and declares functions of LLVM
    ("numba.core.typing.templates", "AttributeTemplate"),  # types the fields of a pack
    ("numba.core.typing.templates", "ConcreteTemplate"),  # types the operators of a vector
    ("numba.core.typing.templates", "infer_global"),  # declares the operators of a vector
    ("numba.core.typing.templates", "signature"),
    ("numba.np.arrayobj", "populate_array"),  # makes an array of an address and a shape
    ("llvmlite.binding", "create_mcjit_compiler"),  # loads the machine code of a model's functions
)
# A function of our own texts: LLVM before version 17 knows no pointers without the type of what they point to.
_TEXT = "define double @first(ptr %x) {\n  %y = load double, ptr %x\n  ret double %y\n}\n"


@cache
def _print_once(text: str) -> None:
    print(f"hybridsim: {text}", file=sys.stderr, flush=True)


def _version() -> str:
    numba = importlib.import_module("numba")
    return f"numba {numba.__version__}"


def find_part(module: str, name: str, without: str) -> Any:
    """Return a part of numba or llvmlite. If the part is missing, print the consequence once and return None."""
    found = _found(module, name)
    if found is None:
        _print_once(f"{_version()} has no {module}.{name}; {without}")
    return found


def _found(module: str, name: str) -> Any:
    try:
        return getattr(importlib.import_module(module), name, None)
    except ImportError:
        return None


def needed(name: str) -> Any:
    """Return a part of numba; `is_complete` has checked that the part exists."""
    return next(_found(module, known) for module, known in _NEEDED if known == name)


@cache
def is_complete() -> bool:
    """Return whether this numba has every part that kernels need. If a part is missing, print a note once."""
    lacking = next((f"no {module}.{name}" for module, name in _NEEDED if _found(module, name) is None), None)
    if lacking is None:
        try:
            importlib.import_module("llvmlite.binding").parse_assembly(_TEXT)
        except RuntimeError:
            lacking = "an LLVM without opaque pointers"
    if lacking is not None:
        _print_once(f"{_version()} has {lacking}; the engine is not compiled, and runs are slow")
    return lacking is None


@cache
def options() -> dict[str, bool]:
    """Return the undocumented options of kernels that this version of numba has.

    `_nrt`: without it each read of an array from a pack includes two calls that count references, and no value
    stays in a register across them. `no_cfunc_wrapper`: without it each kernel gets a wrapper that nothing calls.
    """
    target = find_part(
        "numba.core.registry", "cpu_target", "kernels are compiled with numba's own settings, and run slower"
    )
    requested = {"_nrt": False, "no_cfunc_wrapper": True}
    known = {
        name: value for name, value in requested.items() if hasattr(getattr(target, "options", None), name)
    }
    if target is not None and known != requested:
        _print_once(
            f"{_version()} lacks the options {', '.join(requested.keys() - known)}; kernels are slower"
        )
    return known
