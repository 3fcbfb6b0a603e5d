"""This module defines a vector of eight doubles for kernels.

LLVM turns a loop over a few lanes into vectors of sixteen and a scalar rest. Here all operations are on
vectors, and arrays are padded to whole vectors. Processors with shorter vectors use two or four of theirs. A
product and a sum may be fused. Without the compiler a vector is an array.
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np

from hybridsim.engine.native.inner_parts import needed
from hybridsim.engine.native.kernels import ENABLED, inlined

WIDTH = 8

if ENABLED:
    from llvmlite import ir
    from numba import types
    from numba.extending import intrinsic, lower_builtin, models, register_model

    cgutils, signature, infer_global = needed("cgutils"), needed("signature"), needed("infer_global")
    ConcreteTemplate: Any = needed("ConcreteTemplate")
    _VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)

    class Vec8Type(types.Type):
        """The numba type of eight doubles."""

        def __init__(self) -> None:
            super().__init__(name="Eight")

    _vec8 = Vec8Type()

    @register_model(Vec8Type)
    class _Vec8Model(models.PrimitiveModel):
        def __init__(self, manager: Any, kind: Vec8Type) -> None:
            super().__init__(manager, kind, _VECTOR)

    def _binary(symbol: Any, instruction: str) -> None:
        """Define a binary operator of Python for vectors."""

        @infer_global(symbol)
        class _Typed(ConcreteTemplate):
            cases = [signature(_vec8, _vec8, _vec8)]  # noqa: RUF012 (numba's own form)

        @lower_builtin(symbol, Vec8Type, Vec8Type)
        def _lowered(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return getattr(builder, instruction)(*args, flags=("contract",))

    for _symbol, _instruction in (
        (operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul"), (operator.truediv, "fdiv"),
    ):  # fmt: skip
        _binary(_symbol, _instruction)

    def _place(context: Any, builder: Any, kind: Any, array: Any, at: Any) -> Any:
        data = context.make_array(kind)(context, builder, array).data
        return builder.bitcast(builder.gep(data, [at]), _VECTOR.as_pointer())

    @intrinsic
    def load(typingctx: Any, array: Any, at: Any) -> Any:
        """Load eight numbers from an array, starting at a flat index."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return builder.load(_place(context, builder, sig.args[0], *args), align=8)

        return signature(_vec8, array, types.int64), generate

    @intrinsic
    def store(typingctx: Any, array: Any, at: Any, value: Any) -> Any:
        """Store eight numbers in an array."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            builder.store(args[2], _place(context, builder, sig.args[0], *args[:2]), align=8)
            return context.get_dummy_value()

        return signature(types.void, array, types.int64, _vec8), generate

    @intrinsic
    def put(typingctx: Any, array: Any, at: Any, value: Any) -> Any:
        """Store one number in an array at a flat index."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            data = context.make_array(sig.args[0])(context, builder, args[0]).data
            builder.store(args[2], builder.gep(data, [args[1]]))
            return context.get_dummy_value()

        return signature(types.void, array, types.int64, types.float64), generate

    @intrinsic
    def splat(typingctx: Any, value: Any) -> Any:
        """Return a vector with one number in all lanes."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            blank = ir.Constant(_VECTOR, ir.Undefined)
            one = builder.insert_element(blank, args[0], ir.Constant(ir.IntType(32), 0))
            return builder.shuffle_vector(one, blank, ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), None))

        return signature(_vec8, types.float64), generate

    @intrinsic
    def choose(typingctx: Any, mask: Any, value: Any, other: Any) -> Any:
        """Select one value in lanes whose mask is not zero, and another value in other lanes."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            is_set = builder.fcmp_unordered("!=", args[0], ir.Constant(_VECTOR, [0.0] * WIDTH))
            return builder.select(is_set, args[1], args[2])

        return signature(_vec8, _vec8, _vec8, _vec8), generate

    @intrinsic
    def larger(typingctx: Any, value: Any, other: Any) -> Any:
        """Return the larger of two values; if one value is NaN, return the other value."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return builder.select(builder.fcmp_ordered(">", *args), *args)

        return signature(_vec8, _vec8, _vec8), generate

    @intrinsic
    def all_larger(typingctx: Any, value: Any, other: Any) -> Any:
        """Return whether each number of one vector is larger than the number in the same lane of another vector."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            bits = builder.bitcast(builder.fcmp_ordered(">", *args), ir.IntType(WIDTH))
            return builder.icmp_unsigned("==", bits, ir.Constant(ir.IntType(WIDTH), (1 << WIDTH) - 1))

        return signature(types.boolean, _vec8, _vec8), generate

    @intrinsic
    def size(typingctx: Any, value: Any) -> Any:
        """Return the absolute values of a vector."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            kind = ir.FunctionType(_VECTOR, [_VECTOR])
            absolute = cgutils.get_or_insert_function(builder.module, kind, f"llvm.fabs.v{WIDTH}f64")
            return builder.call(absolute, args)

        return signature(_vec8, _vec8), generate

else:

    def load(array: Any, at: int) -> Any:
        """Load eight numbers from an array; negative indices count from its end."""
        return array.reshape(-1)[np.arange(at, at + WIDTH)]

    def store(array: Any, at: int, value: Any) -> None:
        """Store eight numbers in an array."""
        array.reshape(-1)[np.arange(at, at + WIDTH)] = value

    def put(array: Any, at: int, value: float) -> None:
        """Store one number in an array at a flat index."""
        array.reshape(-1)[at] = value

    def splat(value: float) -> Any:
        """Return a vector with one number in all lanes."""
        return np.full(WIDTH, value)

    def choose(mask: Any, value: Any, other: Any) -> Any:
        """Select one value in lanes whose mask is not zero, and another value in other lanes."""
        return np.where(mask != 0.0, value, other)

    def larger(value: Any, other: Any) -> Any:
        """Return the larger of two values; if one value is NaN, return the other value."""
        return np.where(value > other, value, other)

    def all_larger(value: Any, other: Any) -> bool:
        """Return whether each number of one vector is larger than the number in the same lane of another vector."""
        return bool((value > other).all())

    def size(value: Any) -> Any:
        """Return the absolute values of a vector."""
        return abs(value)


@inlined
def whole_vectors(count: int) -> int:
    """Round a count up to a multiple of the vector length."""
    return (count + WIDTH - 1) & -WIDTH


def padded_rows(rows: int, columns: int, before: int = 0) -> np.ndarray:
    """Allocate zeros (rows, columns) with alignment and padding for vectors."""
    ahead = -(-before // WIDTH) * WIDTH
    whole = np.zeros(ahead + rows * columns + 2 * WIDTH)
    skip = ahead + (-whole.ctypes.data // whole.itemsize) % WIDTH
    return whole[skip : skip + rows * columns].reshape(rows, columns)
