"""Eight doubles at once: vectors as a type of kernels, which the compiler would not make of so short loops.

A loop over a few lanes is made into vectors of sixteen and a rest that runs one by one; here it is all vectors, and the
arrays are longer by what the last one needs. Processors with shorter vectors take two or four of theirs. A product
and a sum may be fused. Without the compiler a vector is an array.
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import ENABLED, inlined

WIDTH = 8
_LINE = 64  # bytes of such a vector, and of a line of the cache

if ENABLED:
    from llvmlite import ir
    from numba import types
    from numba.core import cgutils
    from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
    from numba.extending import intrinsic, lower_builtin, models, register_model

    _VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)

    class EightType(types.Type):
        """Type of eight doubles."""

        def __init__(self) -> None:
            super().__init__(name="Eight")

    _eight = EightType()

    @register_model(EightType)
    class _EightModel(models.PrimitiveModel):
        def __init__(self, manager: Any, kind: EightType) -> None:
            super().__init__(manager, kind, _VECTOR)

    def _binary(symbol: Any, instruction: str) -> None:
        """Make a sign of Python's work on vectors."""

        @infer_global(symbol)
        class _Typed(ConcreteTemplate):
            cases = [signature(_eight, _eight, _eight)]  # noqa: RUF012 (numba's own form)

        @lower_builtin(symbol, EightType, EightType)
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
        """Eight numbers from a place on, counted through all rows of an array."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return builder.load(_place(context, builder, sig.args[0], *args), align=8)

        return signature(_eight, array, types.int64), generate

    @intrinsic
    def store(typingctx: Any, array: Any, at: Any, value: Any) -> Any:
        """Put eight numbers into an array."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            builder.store(args[2], _place(context, builder, sig.args[0], *args[:2]), align=8)
            return context.get_dummy_value()

        return signature(types.void, array, types.int64, _eight), generate

    @intrinsic
    def put(typingctx: Any, array: Any, at: Any, value: Any) -> Any:
        """Put one number into an array, at a place as of `store`."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            data = context.make_array(sig.args[0])(context, builder, args[0]).data
            builder.store(args[2], builder.gep(data, [args[1]]))
            return context.get_dummy_value()

        return signature(types.void, array, types.int64, types.float64), generate

    @intrinsic
    def splat(typingctx: Any, value: Any) -> Any:
        """One number eight times."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            blank = ir.Constant(_VECTOR, ir.Undefined)
            one = builder.insert_element(blank, args[0], ir.Constant(ir.IntType(32), 0))
            return builder.shuffle_vector(one, blank, ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), None))

        return signature(_eight, types.float64), generate

    @intrinsic
    def choose(typingctx: Any, mask: Any, value: Any, other: Any) -> Any:
        """A value where the mask is not zero, the other where it is."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            is_set = builder.fcmp_unordered("!=", args[0], ir.Constant(_VECTOR, [0.0] * WIDTH))
            return builder.select(is_set, args[1], args[2])

        return signature(_eight, _eight, _eight, _eight), generate

    @intrinsic
    def larger(typingctx: Any, value: Any, other: Any) -> Any:
        """The larger of two, the other where one is no number."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return builder.select(builder.fcmp_ordered(">", *args), *args)

        return signature(_eight, _eight, _eight), generate

    @intrinsic
    def all_larger(typingctx: Any, value: Any, other: Any) -> Any:
        """Whether each number of one is larger than that of the other."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            bits = builder.bitcast(builder.fcmp_ordered(">", *args), ir.IntType(WIDTH))
            return builder.icmp_unsigned("==", bits, ir.Constant(ir.IntType(WIDTH), (1 << WIDTH) - 1))

        return signature(types.boolean, _eight, _eight), generate

    @intrinsic
    def size(typingctx: Any, value: Any) -> Any:
        """Absolute values."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            kind = ir.FunctionType(_VECTOR, [_VECTOR])
            absolute = cgutils.get_or_insert_function(builder.module, kind, f"llvm.fabs.v{WIDTH}f64")
            return builder.call(absolute, args)

        return signature(_eight, _eight), generate

else:

    def load(array: Any, at: int) -> Any:
        """Eight numbers from a place on, counted through all rows of an array; before the first is its end."""
        return array.reshape(-1)[np.arange(at, at + WIDTH)]

    def store(array: Any, at: int, value: Any) -> None:
        """Put eight numbers into an array."""
        array.reshape(-1)[np.arange(at, at + WIDTH)] = value

    def put(array: Any, at: int, value: float) -> None:
        """Put one number into an array, at a place as of `store`."""
        array.reshape(-1)[at] = value

    def splat(value: float) -> Any:
        """One number eight times."""
        return np.full(WIDTH, value)

    def choose(mask: Any, value: Any, other: Any) -> Any:
        """A value where the mask is not zero, the other where it is."""
        return np.where(mask != 0.0, value, other)

    def larger(value: Any, other: Any) -> Any:
        """The larger of two, the other where one is no number."""
        return np.where(value > other, value, other)

    def all_larger(value: Any, other: Any) -> bool:
        """Whether each number of one is larger than that of the other."""
        return bool((value > other).all())

    def size(value: Any) -> Any:
        """Absolute values."""
        return abs(value)


@inlined
def whole_vectors(count: int) -> int:
    """So many numbers, and those that fill the last vector."""
    return (count + WIDTH - 1) & -WIDTH


def room_for(rows: int, columns: int, before: int = 0) -> np.ndarray:
    """Zeros (rows, columns) that begin on a line of the cache; vectors may reach beyond the end, or so far before."""
    ahead = -(-before // WIDTH) * WIDTH
    whole = np.zeros(ahead + rows * columns + 2 * WIDTH)
    skip = ahead + (-whole.ctypes.data // whole.itemsize) % WIDTH
    return whole[skip : skip + rows * columns].reshape(rows, columns)
