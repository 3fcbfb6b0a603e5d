"""The only interface to numba: it compiles kernels and calls model functions through their addresses.

A model function has one signature, ``f(t, x, p, z, out) -> status``. With the compiler on it is a C function
reached through its address, so that a kernel is compiled once and never per model; with ``HYBRIDSIM_JIT=0``
the "address" is the Python function itself and every kernel runs as plain Python.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache, wraps
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np

from hybridsim.engine.native.cache import cache_root, kernel_folder, store
from hybridsim.engine.native.inner_parts import find_part, is_complete, needed, options

ENABLED = os.environ.get("HYBRIDSIM_JIT", "1") != "0"
if ENABLED:
    import numba

    ENABLED = not numba.config.DISABLE_JIT and is_complete()  # NUMBA_DISABLE_JIT=1 turns all compilation off

_NOTICED = 1.0  # seconds of compilation after which a message is printed
_reached: list[Any] = []  # functions by their number, kept alive here


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
    from llvmlite import binding, ir
    from numba import types
    from numba.extending import intrinsic

    from hybridsim.engine.native.kernel_cache import cache_on_disk
    from hybridsim.engine.native.llvm import (
        compile_text,
        definition_in,
        functions_in,
        load_or_compile,
        machine_name,
    )

    cgutils, populate_array = needed("cgutils"), needed("populate_array")
    cpu_target = find_part(
        "numba.core.registry", "cpu_target", "kernels are compiled with numba's own settings, and run slower"
    )
    event = find_part("numba.core", "event", "compiling takes longer, and its time is not measured")
    compiler_lock = find_part(
        "numba.core", "compiler_lock", "a process forked while another thread compiles may wait indefinitely"
    )
    CFunc = find_part("numba.core.ccallback", "CFunc", "each process compiles the largest kernels again")
    _Listener: Any = getattr(event, "Listener", object)
    _lock: Any = getattr(compiler_lock, "global_compiler_lock", None) or threading.RLock()

    _DOUBLES = types.CPointer(types.float64)
    _LONGS = types.CPointer(types.int64)
    SIGNATURE = types.int32(types.float64, _DOUBLES, _DOUBLES, _LONGS, _DOUBLES)

    class _Spent(threading.local):
        """The compile time of a thread: current depth, start of the current compilation, earlier seconds."""

        depth, since, spent = 0, 0.0, 0.0

    class _Compiling(_Listener):
        """Measures the seconds that each thread spends on compiling, and sets the optimisation level.

        Compilation holds numba's lock, so the global settings can be changed meanwhile.
        """

        def __init__(self) -> None:
            self.of = _Spent()
            self.others: list[Any] = []  # settings to restore, one entry per nested compilation

        def on_start(self, event: Any) -> None:
            """Record that a kernel, or a kernel that it calls, starts to compile."""
            of = self.of
            if event.kind == _COMPILING:  # not in the cache
                compiled = event.data["dispatcher"].py_func.__module__ or ""
                so_far = of.spent + (time.perf_counter() - of.since if of.depth else 0.0)
                self.others.append(_settings())
                if compiled.startswith("hybridsim."):
                    _set(_ours())
                    if so_far > _NOTICED:  # a part that no earlier run needed, such as derivatives
                        _tell(
                            f"hybridsim: compiling another part of the engine (once, 10 to 30 s); {_cache_state()} ..."
                        )
                return
            if of.depth == 0:
                of.since = time.perf_counter()
            of.depth += 1

        def on_end(self, event: Any) -> None:
            """Record that a kernel is compiled."""
            of = self.of
            if event.kind == _COMPILING:
                _set(self.others.pop())
                return
            if of.depth == 0:
                return
            of.depth -= 1
            if of.depth == 0:
                of.spent += time.perf_counter() - of.since

    _LEVEL = 2  # optimisation level of LLVM

    def _settings() -> tuple[Any, Any]:
        """Return LLVM's optimisation level and target machine, or None if numba does not provide them."""
        return numba.config.OPT, getattr(_code_generator(), "_tm", None)

    def _code_generator() -> Any:
        return None if cpu_target is None else cpu_target.target_context.codegen()

    def _set(settings: tuple[Any, Any]) -> None:
        numba.config.OPT, machine = settings
        if machine is not None:
            _code_generator()._tm = machine

    @cache
    def _plain_machine() -> Any:
        """Return this machine with a generic cost model, or None if numba does not provide it."""
        features = getattr(_code_generator(), "_tm_features", None)
        if features is None or _settings()[1] is None:
            return None
        cpu = "x86-64" if binding.get_default_triple().startswith("x86_64") else "generic"
        return binding.Target.from_default_triple().create_target_machine(
            cpu=cpu, features=features, jit=True
        )

    def _ours() -> tuple[Any, Any]:
        """Return hybridsim's compiler settings for kernels.

        At level 2 the engine compiles in seven eighths of the time of numba's default, level 3, and runs as
        fast. For some machines (AMD's Zen 4 and 5) LLVM unrolls loops of unknown length a dozen times. Our
        loops have two or three turns, and `exact` takes a fifth longer with such unrolling.
        """
        return min(numba.config.OPT, type(numba.config.OPT)(_LEVEL)), _plain_machine()

    _COMPILING, _LOCKED = "numba:compile", "numba:compiler_lock"  # compilation happens while the lock is held
    _compiling = _Compiling()
    for _kind in (_COMPILING, _LOCKED) if event else ():
        event.register(_kind, _compiling)

    def _free_in_child() -> None:
        """Release numba's lock in a child process that was forked while another thread was compiling."""
        if hasattr(_lock, "_lock"):
            _lock._lock = threading.RLock()

    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_free_in_child)

    def seconds_compiling() -> float:
        """Return the seconds that this thread has spent on compiling or loading kernels."""
        return _compiling.of.spent

    def _compiled(function: Callable[..., Any], allocates: bool = False, **more: Any) -> Any:
        """Compile a kernel with hybridsim's options of numba.

        Only a kernel that allocates counts references to arrays.
        """
        more |= options()
        if "_nrt" in more:  # said of each kernel, since one without it has the setting of its caller
            more["_nrt"] = allocates
        made = numba.njit(nogil=True, error_model="numpy", **more)(function)
        cache_on_disk(made, function)
        return made

    def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
        """Compile a function of the engine and cache it on disk; division by zero gives inf or nan."""
        return _compiled(function)

    def allocating_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
        """Compile a kernel that allocates arrays."""
        return _compiled(function, allocates=True)

    def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
        """Mark a short kernel to be inlined into its callers."""
        return _compiled(function, forceinline=True)

    def inline_always(function: Callable[..., Any]) -> Callable[..., Any]:
        """Mark a function to be inlined into the one kernel that calls it; it is not compiled separately."""
        return _compiled(function, inline="always")

    def polynomial_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
        """Mark a short kernel to be inlined; the compiler may fuse a product and a sum in it."""
        return _compiled(function, forceinline=True, fastmath={"contract"})

    def _entry(function: Any, arguments: tuple[Any, ...]) -> Callable[..., Any]:
        found: Callable[..., Any] = function.compile(
            tuple(map(getattr(function, "typeof_pyval", numba.typeof), arguments))
        )
        return found

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

    @intrinsic
    def fused(typingctx: Any, a: Any, b: Any, c: Any) -> Any:
        """Compute a*b + c of three doubles, rounded only once if the processor supports it."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            double = ir.DoubleType()
            kind = ir.FunctionType(double, [double] * 3)
            function = cgutils.get_or_insert_function(builder.module, kind, "llvm.fmuladd.f64")
            return builder.call(function, args)

        return types.float64(types.float64, types.float64, types.float64), generate

    @intrinsic
    def call_series(
        typingctx: Any, address: Any, s: Any, error: Any, x: Any, guards: Any, constants: Any, out: Any
    ) -> Any:
        """Call the series function at an address with contiguous arrays."""
        signature = types.void(types.int64, types.float64, types.float64, x, guards, constants, out)

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            double = ir.DoubleType()
            pointer = ir.PointerType(double)
            kind = ir.FunctionType(ir.VoidType(), [double, double, *[pointer] * 4])
            target = builder.inttoptr(args[0], ir.PointerType(kind))
            data = [
                context.make_array(ty)(context, builder, value).data
                for ty, value in zip(sig.args[3:], args[3:], strict=True)
            ]
            builder.call(target, [args[1], args[2], *data])
            return context.get_dummy_value()

        return signature, generate

    def _type_by_address(value: Any) -> Any:
        """Return the type of an argument for a kernel that is called by its address."""
        found = numba.typeof(value)
        return types.CPointer(found.dtype) if isinstance(found, types.Array) else found

    def _kernel_at(function: Callable[..., int], key: tuple[Any, ...]) -> int:
        with _lock:
            others = _settings()
            _set(_ours())
            try:
                own = {
                    "error_model": "numpy",
                    **{name: on for name, on in options().items() if name == "_nrt"},
                }
                if CFunc is None:
                    made = numba.cfunc(types.int64(*key), **own)(function)
                else:
                    made = CFunc(function, (key, types.int64), locals={}, options=own)
                    cache_on_disk(made, function)
                    made.compile()
            finally:
                _set(others)
        _reached.append(made)
        address: Any = made.address
        return int(address)

    @intrinsic
    def call_kernel(typingctx: Any, address: Any, arguments: Any) -> Any:
        """Call the kernel at an address with a tuple of packs, numbers and contiguous arrays."""
        arguments = types.Tuple([types.unliteral(a) for a in arguments])
        signature = types.int64(types.int64, arguments)

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            passed = [
                context.make_array(ty)(context, builder, value).data if isinstance(ty, types.Array) else value
                for ty, value in zip(
                    arguments, cgutils.unpack_tuple(builder, args[1], len(arguments)), strict=True
                )
            ]
            kind = ir.FunctionType(ir.IntType(64), [value.type for value in passed])
            return builder.call(builder.inttoptr(args[0], ir.PointerType(kind)), passed)

        return signature, generate

    @intrinsic
    def array_at(typingctx: Any, elements: Any, size: Any) -> Any:
        """Return an array of a given size over the memory that a kernel received by address."""
        kind = types.Array(elements.dtype, 1, "C")

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            array = context.make_array(kind)(context, builder)
            step = context.get_constant(types.intp, context.get_abi_sizeof(array.data.type.pointee))
            populate_array(array, data=args[0], shape=[args[1]], strides=[step], itemsize=step, meminfo=None)
            return array._getvalue()

        return kind(elements, types.intp), generate

    @intrinsic
    def call_noinline(typingctx: Any, kernel: Any, arguments: Any) -> Any:
        """Call a kernel with a tuple of arguments and prevent its inlining.

        LLVM inlines even long kernels into all callers and compiles each copy again.
        """
        called = kernel.get_call_type(typingctx, tuple(map(types.unliteral, arguments.types)), {})

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            target = context.get_function(kernel, called)
            values = cgutils.unpack_tuple(builder, args[1], len(arguments))
            casts = zip(values, arguments.types, called.args, strict=True)
            before = {id(i) for block in builder.function.blocks for i in block.instructions}
            result = target(
                builder, [context.cast(builder, value, have, want) for value, have, want in casts]
            )
            for block in builder.function.blocks:
                for instruction in block.instructions:
                    if isinstance(instruction, ir.CallInstr) and id(instruction) not in before:
                        instruction.attributes.add("noinline")
            return result

        return called.return_type(kernel, arguments), generate

    @intrinsic
    def call(typingctx: Any, function: Any, t: Any, x: Any, p: Any, z: Any, out: Any) -> Any:
        """Call the model function at an address with contiguous arrays; return its status."""
        signature = types.int32(types.int64, types.float64, x, p, z, out)

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            double, long, status = ir.DoubleType(), ir.IntType(64), ir.IntType(32)
            pointers = [ir.PointerType(double)] * 2 + [ir.PointerType(long), ir.PointerType(double)]
            kind = ir.FunctionType(status, [double, *pointers])
            target = builder.inttoptr(args[0], ir.PointerType(kind))
            data = [
                context.make_array(ty)(context, builder, value).data
                for ty, value in zip(sig.args[2:], args[2:], strict=True)
            ]
            data = [builder.bitcast(d, want) for d, want in zip(data, pointers, strict=True)]
            return builder.call(target, [args[1], *data])

        return signature, generate

else:

    def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
        """Return a Python function without NumPy's warnings, because the compiler is off."""

        @wraps(function)
        def quiet(*arguments: Any) -> Any:
            with np.errstate(all="ignore"):
                return function(*arguments)

        return quiet

    def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the function unchanged, because its caller runs as Python."""
        return function

    inline_always = polynomial_kernel = inlined
    allocating_kernel = kernel

    def seconds_compiling() -> float:
        """Return None, because nothing is compiled."""
        return 0.0

    def _entry(function: Any, arguments: tuple[Any, ...]) -> Callable[..., Any]:
        return function

    def compile_series(
        stored: Path | None, names: Sequence[str], written: Callable[[], str]
    ) -> tuple[list[int], Any]:
        """Raise NotImplementedError; the translation requires the compiler, which is off."""
        raise NotImplementedError

    def is_stored(stored: Path | None) -> bool:
        """Return False, because nothing is cached."""
        return False

    def fused(a: float, b: float, c: float) -> float:
        """Compute a*b + c of three doubles."""
        return a * b + c

    def call_series(
        address: int, s: float, error: float, x: Any, guards: Any, constants: Any, out: Any
    ) -> None:
        """Raise NotImplementedError; series functions require the compiler, which is off."""
        raise NotImplementedError

    def _type_by_address(value: Any) -> Any:
        """Return None, because kernels need no argument types if the compiler is off."""
        return None

    def _kernel_at(function: Callable[..., int], key: tuple[Any, ...]) -> int:
        if function not in _reached:
            _reached.append(function)
        return _reached.index(function)

    def call_kernel(address: int, arguments: tuple[Any, ...]) -> int:
        """Call a function by its number; numbers replace addresses if the compiler is off."""
        return int(_reached[address](*arguments))

    def array_at(elements: Any, size: int) -> Any:
        """Return the array itself, because the compiler is off."""
        return elements

    def compile_model_function(module: Any, name: str) -> tuple[Any, Any]:
        """Wrap a model function so that it computes as compiled code does."""
        return (as_compiled(getattr(module, name)),) * 2

    def texts_to_compile(module: Any) -> list[str]:
        """Return an empty list, because nothing is compiled."""
        return []

    def call_noinline(kernel: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        """Call a kernel as a Python function, because the compiler is off."""
        return kernel(*arguments)

    def call(function: Any, t: float, x: Any, p: Any, z: Any, out: Any) -> int:
        """Call a model function in Python, because the compiler is off."""
        return function(t, x, p, z, out)


_addresses: dict[tuple[Any, ...], int] = {}  # addresses of kernels, by their argument types


def kernel_address(function: Callable[..., int], *examples: Any) -> int:
    """Return the address of a kernel that returns an integer, for arguments of the given types.

    The kernel is compiled if necessary. A kernel that calls others directly is compiled together with them,
    again for each caller; large kernels are compiled once because they are called by address. Only the
    elements of an array are passed: see `array_at`. Without a compiler the address is a number that
    identifies the function.
    """
    key = tuple(map(_type_by_address, examples))
    if (function, key) not in _addresses:
        _addresses[function, key] = _kernel_at(function, key)
    return _addresses[function, key]


class Precompiled:
    """A kernel with the same argument types at every call, which are resolved only once.

    Resolving the types of packs takes longer than a short run.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self._entry: Callable[..., Any] | None = None

    def __call__(self, *arguments: Any) -> Any:
        """Call the kernel and return its result."""
        if self._entry is None:
            self._entry = _entry(self._function, arguments)
        return self._entry(*arguments)


@cache
def announce_compilation() -> None:
    """Print on stderr, once for each cache, that the engine is being compiled."""
    # an existing folder is no proof, because it is created when a kernel is defined
    folder = kernel_folder() if ENABLED else None
    if ENABLED and (folder is None or not (folder / "announced").exists()):
        store(folder and folder / "announced", b"")
        _tell(f"hybridsim: compiling the engine (once, about 30 s per integrator); {_cache_state()} ...")


def _cache_state() -> str:
    return "not cached" if kernel_folder() is None else f"cached in {cache_root()}"


_announced: set[str] = set()  # once per process


def _tell(text: str) -> None:
    if not _announced:
        _announced.add(text)
        print(text, file=sys.stderr, flush=True)
