"""This module compiles generated functions to machine code with LLVM."""

from __future__ import annotations

import ctypes
import ctypes.util
import hashlib
import re
import sys
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from llvmlite import binding, ir

from hybridsim.engine.native.cache import load_whole, store_whole
from hybridsim.engine.native.inner_parts import find_part
from hybridsim.engine.native.translator import OF_C, Translator
from hybridsim.expr.python_tree import python_tree

_INLINED = 20_000  # characters of a text whose functions are inlined into each other, whatever their lengths


@cache
def _prepare() -> None:
    """Initialise LLVM for this machine and register the functions of the C library."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    library = ctypes.CDLL(ctypes.util.find_library("m")) if sys.platform != "win32" else ctypes.cdll.msvcrt
    for name in OF_C:
        address = ctypes.cast(getattr(library, name), ctypes.c_void_p).value
        binding.add_symbol(f"c_{name}", address)


def _machine() -> Any:
    """Return a new LLVM target machine for this computer, for one compilation."""
    _prepare()
    return binding.Target.from_default_triple().create_target_machine(
        cpu=binding.get_host_cpu_name(), features=binding.get_host_cpu_features().flatten(), opt=2
    )


def compile_text(text: str, name: str, stored: Path | None) -> tuple[int, Any]:
    """Compile a function from the text of a module; return its address and an object that keeps it alive.

    stored: path of its cached machine code, if any; written at the first compilation.
    """
    addresses, engine = load_or_compile(stored, (name,), lambda: _translated(text, name))
    return addresses[0], engine


def load_or_compile(
    stored: Path | None, names: Sequence[str], written: Callable[[], str]
) -> tuple[list[int], Any]:
    """Return the addresses of functions of an LLVM module, and an object that keeps them alive.

    stored: path of the cached machine code, if any. If the file does not exist, the text that `written` returns
    is compiled and stored.
    """
    code = load_whole(stored)
    if code is None:
        code = _compiled(written())
        store_whole(stored, code)
    _prepare()
    engine = binding.create_mcjit_compiler(binding.parse_assembly(""), _machine())
    engine.add_object_file(binding.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return [engine.get_function_address(name) for name in names], engine


def _translated(text: str, name: str) -> str:
    """Translate a function of a generated module into an LLVM module."""
    return translated(definition_in(text, name), (name,))


def translated(text: str, names: Sequence[str]) -> str:
    """Translate functions into one LLVM module; a function may call the functions before it."""
    module = ir.Module(names[0])
    for definition in python_tree(text).body:
        function = Translator(module, definition).function
        if definition.name not in names:
            function.linkage = "internal"
        if len(text) < _INLINED:
            function.attributes.add("alwaysinline")
    return str(module)


def functions_in(text: str) -> list[str]:
    """Return the names of those functions of a generated module that are compiled."""
    return re.findall(r"^def (\w+)\(t, x, p, z, out", text, re.MULTILINE)


def definition_in(text: str, name: str) -> str:
    """Return the lines of one function of a generated module, without parsing the whole module."""
    found = re.search(rf"^def {name}\(.*?(?=^\S|\Z)", text, re.MULTILINE | re.DOTALL)
    assert found is not None, f"the module has no function {name}"
    return found.group()


def _compiled(text: str) -> bytes:
    """Compile an LLVM module to an object file for this machine."""
    machine = _machine()
    parsed = binding.parse_assembly(text)
    parsed.triple = machine.triple
    parsed.verify()
    create = find_part("llvmlite.binding", "create_pass_builder", "the functions of models run slower")
    if create is not None:
        builder = create(machine, binding.create_pipeline_tuning_options(speed_level=2))
        builder.getModulePassManager().run(parsed, builder)
    return bytes(machine.emit_object(parsed))


@cache
def machine_name() -> str:
    """Return a short name of the machine type for which code is compiled."""
    features = binding.get_host_cpu_features().flatten()
    described = f"{binding.get_default_triple()} {binding.get_host_cpu_name()} {features}"
    return hashlib.sha256(described.encode()).hexdigest()[:12]
