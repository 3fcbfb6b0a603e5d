"""This module marks loops over short arrays, which LLVM should neither unroll nor vectorise.

For arrays of two or three entries most of the code of a vectorised loop only prepares it for long arrays.
"""

from __future__ import annotations

from typing import Any

from hybridsim.engine.native.kernels import ENABLED, inlined

_MAX_INDEX = (1 << 31) - 1

if ENABLED:
    from llvmlite import ir
    from numba import types
    from numba.extending import intrinsic

    def left_as_it_is(builder: Any) -> None:
        """Emit an opaque empty statement, so that LLVM does not vectorise or unroll the loop around it."""
        nothing = ir.InlineAsm(ir.FunctionType(ir.VoidType(), []), "", "", side_effect=True)
        call = builder.call(nothing, [])
        call.attributes.add("nounwind")
        call.attributes.add("readnone")

    @intrinsic
    def short_loop(typingctx: Any) -> Any:
        """Mark the loop around this call as a short loop."""

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            left_as_it_is(builder)
            return context.get_dummy_value()

        return types.void(), generate

else:

    def short_loop() -> None:
        """Do nothing, because the compiler is off."""


@inlined
def index(i: int) -> int:
    """Mark an index as not negative, so that LLVM does not test whether it counts from the end of an array."""
    return i & _MAX_INDEX


@inlined
def put(source: Any, out: Any) -> None:
    """Copy a short array faster than a slice assignment does."""
    for i in range(source.shape[0]):
        short_loop()
        out[i] = source[i]


@inlined
def fill(out: Any, value: Any) -> None:
    """Write one value to all elements of a short array."""
    for i in range(out.shape[0]):
        short_loop()
        out[i] = value
