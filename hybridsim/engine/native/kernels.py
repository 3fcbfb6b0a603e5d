"""The interface to numba: it compiles kernels, and calls kernels and functions of models by their addresses.

With ``HYBRIDSIM_JIT=0`` every kernel runs as plain Python, and the "address" of a function is the function itself.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np

from hybridsim.engine.native.compiler import ENABLED as ENABLED
from hybridsim.engine.native.inner_parts import find_part, needed, options

_reached: list[Any] = []  # functions by their number, kept alive here


if ENABLED:
    import numba
    from llvmlite import ir
    from numba import types
    from numba.extending import intrinsic

    from hybridsim.engine.native.compiler import with_our_settings
    from hybridsim.engine.native.kernel_cache import cache_on_disk

    cgutils, populate_array = needed("cgutils"), needed("populate_array")
    CFunc = find_part("numba.core.ccallback", "CFunc", "each process compiles the largest kernels again")

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
        with with_our_settings():
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

    def _entry(function: Any, arguments: tuple[Any, ...]) -> Callable[..., Any]:
        return function

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
    """A kernel whose argument types are determined only once, because they are equal at every call.

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
