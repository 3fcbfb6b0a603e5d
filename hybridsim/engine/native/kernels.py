"""The one door to numba: compiled kernels, and calls of model functions through their addresses.

A model function has one signature, ``f(t, x, p, z, out) -> status``. With the compiler on it is a C function
reached through its address, so that a kernel is compiled once and never per model; with ``HYBRIDSIM_JIT=0`` the
"address" is the Python function itself and every kernel runs as plain Python.
"""

from __future__ import annotations

import math
import os
import sys
import threading
import time
from collections.abc import Callable, Sequence
from functools import cache, wraps
from pathlib import Path
from typing import Any

import numpy as np

from hybridsim.engine.native.cache import cache_root, kernel_folder, store

ENABLED = os.environ.get("HYBRIDSIM_JIT", "1") != "0"
if ENABLED:
    import numba

    ENABLED = not numba.config.DISABLE_JIT  # of everything, by NUMBA_DISABLE_JIT=1

_NOTICED = 1.0  # seconds of compiling that a person wonders about
_reached: list[Any] = []  # by address, and kept alive


def _fill_nan(out: Any) -> None:
    for i in range(len(out)):
        out[i] = math.nan


if ENABLED:
    from llvmlite import binding, ir
    from numba import types
    from numba.core import cgutils, compiler_lock, event
    from numba.core.ccallback import CFunc
    from numba.core.registry import cpu_target
    from numba.extending import intrinsic
    from numba.np.arrayobj import populate_array

    from hybridsim.engine.native.kernel_cache import keep_on_disk
    from hybridsim.engine.native.llvm import compile_text, definition_in, functions_in, machine_name, ready

    _DOUBLES = types.CPointer(types.float64)
    _LONGS = types.CPointer(types.int64)
    SIGNATURE = types.int32(types.float64, _DOUBLES, _DOUBLES, _LONGS, _DOUBLES)

    class _Spent(threading.local):
        """Of a thread: how deep it is in compiling, since when, and the seconds of all times before."""

        depth, since, spent = 0, 0.0, 0.0

    class _Compiling(event.Listener):
        """Adds up what each thread spends on compiling kernels, or on reading them from the cache; sets the effort.

        Compiling holds numba's lock, so the settings, which are everybody's, are ours meanwhile.
        """

        def __init__(self) -> None:
            self.of = _Spent()
            self.others: list[Any] = []  # settings before each of the kernels that are being compiled

        def on_start(self, event: Any) -> None:
            """A kernel, or one that another needs."""
            of = self.of
            if event.kind == _COMPILING:  # it was not in the cache
                compiled = event.data["dispatcher"].py_func.__module__ or ""
                so_far = of.spent + (time.perf_counter() - of.since if of.depth else 0.0)
                self.others.append(_settings())
                if compiled.startswith("hybridsim."):
                    _set(_ours())
                    if so_far > _NOTICED:  # a part that no run has needed before, such as derivatives
                        _tell(
                            f"hybridsim: compiling the engine for a new task (once, 10 to 30 s); {_kept()} ..."
                        )
                return
            if of.depth == 0:
                of.since = time.perf_counter()
            of.depth += 1

        def on_end(self, event: Any) -> None:
            """The kernel is ready."""
            of = self.of
            if event.kind == _COMPILING:
                _set(self.others.pop())
                return
            if of.depth == 0:
                return
            of.depth -= 1
            if of.depth == 0:
                of.spent += time.perf_counter() - of.since

    _LEVEL = 2  # of LLVM's passes

    def _settings() -> tuple[Any, Any]:
        """Level of LLVM's passes, and the machine whose costs they go by; None where numba does not tell it."""
        return numba.config.OPT, getattr(cpu_target.target_context.codegen(), "_tm", None)

    def _set(settings: tuple[Any, Any]) -> None:
        numba.config.OPT, machine = settings
        if machine is not None:
            cpu_target.target_context.codegen()._tm = machine

    @cache
    def _plain_machine() -> Any:
        """This machine with what it has, and the costs of none in particular; None where numba does not tell it."""
        features = getattr(cpu_target.target_context.codegen(), "_tm_features", None)
        if features is None or _settings()[1] is None:
            return None
        cpu = "x86-64" if binding.get_default_triple().startswith("x86_64") else "generic"
        return binding.Target.from_default_triple().create_target_machine(
            cpu=cpu, features=features, jit=True
        )

    def _ours() -> tuple[Any, Any]:
        """The settings for kernels.

        At the second level the engine is ready an eighth sooner than at numba's default, the third, and is as fast. For
        some machines (AMD's Zen 4 and 5) LLVM unrolls loops of unknown length by the dozen. Ours have two or three
        turns: so unrolled, `exact` takes a fifth longer.
        """
        return min(numba.config.OPT, type(numba.config.OPT)(_LEVEL)), _plain_machine()

    _COMPILING, _LOCKED = "numba:compile", "numba:compiler_lock"  # the first happens within the second
    _compiling = _Compiling()
    for _kind in (_COMPILING, _LOCKED):
        event.register(_kind, _compiling)

    def _free_in_child() -> None:
        """A child that was forked while another thread was compiling finds numba's lock free."""
        if hasattr(compiler_lock.global_compiler_lock, "_lock"):
            compiler_lock.global_compiler_lock._lock = threading.RLock()

    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_free_in_child)

    def seconds_compiling() -> float:
        """Seconds that this thread has spent so far on getting kernels ready."""
        return _compiling.of.spent

    def _compiled(function: Callable[..., Any], **options: Any) -> Any:
        """A kernel with numba's options; literal arguments make versions of it, which run up to twice as fast.

        Without the option `_nrt` each read of an array from a pack would be two calls that count references, across
        which nothing stays in a register.
        """
        made = numba.njit(nogil=True, error_model="numpy", no_cfunc_wrapper=True, **options)(function)
        keep_on_disk(made, function)
        return made

    def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
        """Compile a function of the engine once, cached on disk; division by zero gives inf or nan, as in numpy."""
        return _compiled(function, _nrt=False)

    def allocating_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
        """A kernel that makes arrays of its own."""
        return _compiled(function, _nrt=True)

    def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
        """A short kernel, made part of its callers."""
        return _compiled(function, forceinline=True, _nrt=False)

    def merged(function: Callable[..., Any]) -> Callable[..., Any]:
        """A part of the one kernel that calls it, with a name of its own; it is never compiled by itself."""
        return _compiled(function, inline="always", _nrt=False)

    def polynomial_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
        """A short kernel, made part of its callers, whose products and sums may be fused, as Horner's rule likes it."""
        return _compiled(function, forceinline=True, fastmath={"contract"}, _nrt=False)

    def _entry(function: Any, arguments: tuple[Any, ...]) -> Callable[..., Any]:
        found: Callable[..., Any] = function.compile(tuple(map(function.typeof_pyval, arguments)))
        return found

    def compile_model_function(module: Any, name: str) -> tuple[Any, Any]:
        """Compile one function of a generated module; return its address and the object that keeps it alive."""
        path = getattr(module, "__file__", None)  # None for a module that is in memory alone
        kept = None if path is None else _of_this_machine(Path(path).with_suffix(f".{name}"))
        return compile_text(module.__loader__.get_source(module.__name__), name, kept)

    def texts_to_compile(module: Any) -> list[str]:
        """The texts of the functions of a generated module whose machine code is not on disk."""
        path, text = getattr(module, "__file__", None), module.__loader__.get_source(module.__name__)
        return [
            definition_in(text, name)
            for name in functions_in(text)
            if path is None or not is_kept(Path(path).with_suffix(f".{name}"))
        ]

    def compile_series(
        kept: Path | None, names: Sequence[str], written: Callable[[], str]
    ) -> tuple[list[int], Any]:
        """Addresses of functions of series, for `call_series`, and the object that keeps them alive."""
        return ready(None if kept is None else _of_this_machine(kept), names, written)

    def is_kept(kept: Path | None) -> bool:
        """Whether functions of series are on disk."""
        return kept is not None and _of_this_machine(kept).exists()

    def _of_this_machine(kept: Path) -> Path:
        return kept.with_name(f"{kept.name}.{machine_name()}.o")

    @intrinsic
    def fused(typingctx: Any, a: Any, b: Any, c: Any) -> Any:
        """a b + c of three doubles, rounded once where the processor can do so."""

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
        """Call the function of series at an address (see `engine.series.emit_series`) with contiguous arrays."""
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

    def _type_by_address(given: Any) -> Any:
        """Of a pack, of a number, or of an array, of which a kernel that is reached by address gets the elements."""
        found = numba.typeof(given)
        return types.CPointer(found.dtype) if isinstance(found, types.Array) else found

    def _kernel_at(function: Callable[..., int], key: tuple[Any, ...]) -> int:
        with compiler_lock.global_compiler_lock:
            others = _settings()
            _set(_ours())
            try:
                options = {"error_model": "numpy", "_nrt": False}
                made = CFunc(function, (key, types.int64), locals={}, options=options)
                keep_on_disk(made, function)
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
            given = [
                context.make_array(ty)(context, builder, value).data if isinstance(ty, types.Array) else value
                for ty, value in zip(
                    arguments, cgutils.unpack_tuple(builder, args[1], len(arguments)), strict=True
                )
            ]
            kind = ir.FunctionType(ir.IntType(64), [value.type for value in given])
            return builder.call(builder.inttoptr(args[0], ir.PointerType(kind)), given)

        return signature, generate

    @intrinsic
    def array_at(typingctx: Any, elements: Any, size: Any) -> Any:
        """The array (size,) whose elements a kernel was given that is reached by its address."""
        kind = types.Array(elements.dtype, 1, "C")

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            array = context.make_array(kind)(context, builder)
            step = context.get_constant(types.intp, context.get_abi_sizeof(array.data.type.pointee))
            populate_array(array, data=args[0], shape=[args[1]], strides=[step], itemsize=step, meminfo=None)
            return array._getvalue()

        return kind(elements, types.intp), generate

    @intrinsic
    def call_apart(typingctx: Any, kernel: Any, arguments: Any) -> Any:
        """Call a kernel with a tuple of arguments, and keep it out of its caller.

        LLVM copies even long kernels into all that call them, and compiles each copy anew.
        """
        called = kernel.get_call_type(typingctx, tuple(map(types.unliteral, arguments.types)), {})

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            target = context.get_function(kernel, called)
            given = cgutils.unpack_tuple(builder, args[1], len(arguments))
            casts = zip(given, arguments.types, called.args, strict=True)
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
        """The function itself: the compiler is switched off. As in compiled code, NaN is no warning."""

        @wraps(function)
        def quiet(*arguments: Any) -> Any:
            with np.errstate(all="ignore"):
                return function(*arguments)

        return quiet

    def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
        """The function itself: what calls it is a kernel."""
        return function

    merged = polynomial_kernel = inlined
    allocating_kernel = kernel

    def seconds_compiling() -> float:
        """None: nothing is compiled."""
        return 0.0

    def _entry(function: Any, arguments: tuple[Any, ...]) -> Callable[..., Any]:
        return function

    def compile_series(
        kept: Path | None, names: Sequence[str], written: Callable[[], str]
    ) -> tuple[list[int], Any]:
        """Nothing is compiled: series are those of the interpreter."""
        raise NotImplementedError

    def is_kept(kept: Path | None) -> bool:
        """Nothing is kept."""
        return False

    def fused(a: float, b: float, c: float) -> float:
        """a b + c."""
        return a * b + c

    def call_series(
        address: int, s: float, error: float, x: Any, guards: Any, constants: Any, out: Any
    ) -> None:
        """Nothing is compiled, and never called."""
        raise NotImplementedError

    def _type_by_address(given: Any) -> Any:
        """Nothing is compiled."""
        return None

    def _kernel_at(function: Callable[..., int], key: tuple[Any, ...]) -> int:
        if function not in _reached:
            _reached.append(function)
        return _reached.index(function)

    def call_kernel(address: int, arguments: tuple[Any, ...]) -> int:
        """Call a function."""
        return int(_reached[address](*arguments))

    def array_at(elements: Any, size: int) -> Any:
        """The array itself."""
        return elements

    def compile_model_function(module: Any, name: str) -> tuple[Any, Any]:
        """Guard the function as compiled code is: what raises in Python is NaN there."""
        function = getattr(module, name)

        def guarded(t: float, x: Any, p: Any, z: Any, out: Any) -> int:
            try:
                return function(t, x, p, z, out)
            except (ZeroDivisionError, ValueError, OverflowError):
                _fill_nan(out)
                return 1

        return guarded, guarded

    def texts_to_compile(module: Any) -> list[str]:
        """Nothing is compiled."""
        return []

    def call_apart(kernel: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        """Call a kernel."""
        return kernel(*arguments)

    def call(function: Any, t: float, x: Any, p: Any, z: Any, out: Any) -> int:
        """Call the model function."""
        return function(t, x, p, z, out)


_addresses: dict[tuple[Any, ...], int] = {}  # of kernels, by the types of what they are given


def kernel_address(function: Callable[..., int], *given: Any) -> int:
    """Address of a kernel that returns a whole number and is called with the like of what is given; see `call_kernel`.

    It is compiled if need be. A kernel that calls others is compiled together with them, again for each caller; large
    ones that are reached by their address are compiled once. Of an array they get the elements alone: see `array_at`.
    Without a compiler it is a number by which the function is found.
    """
    key = tuple(map(_type_by_address, given))
    if (function, key) not in _addresses:
        _addresses[function, key] = _kernel_at(function, key)
    return _addresses[function, key]


class Door:
    """A kernel whose arguments are of the same types at every call: they are looked at once.

    To look at them takes longer than a short run where there are packs among them.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self._entry: Callable[..., Any] | None = None

    def __call__(self, *arguments: Any) -> Any:
        """What the kernel returns."""
        if self._entry is None:
            self._entry = _entry(self._function, arguments)
        return self._entry(*arguments)


@cache
def announce_compilation() -> None:
    """Say once, on stderr, that the engine is being compiled, if no run of it has been announced here yet."""
    # the folder alone proves nothing: it is made as soon as a kernel is defined
    folder = kernel_folder() if ENABLED else None
    if ENABLED and (folder is None or not (folder / "announced").exists()):
        store(folder and folder / "announced", b"")
        _tell(f"hybridsim: compiling the engine (once, about 30 s per integrator); {_kept()} ...")


def _kept() -> str:
    return "not cached" if kernel_folder() is None else f"cached in {cache_root()}"


_told: set[str] = set()  # in this process: one line is enough


def _tell(text: str) -> None:
    if not _told:
        _told.add(text)
        print(text, file=sys.stderr, flush=True)
