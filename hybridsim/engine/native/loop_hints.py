"""Loops over a few numbers in compiled code, that are left as they are written.

Where arrays have two or three entries, most of what a compiler makes of a loop over them is what prepares it for many.
"""

from __future__ import annotations

from typing import Any

from hybridsim.engine.native.kernels import ENABLED, inlined

if ENABLED:
    from llvmlite import ir
    from numba import types
    from numba.extending import intrinsic

    def left_as_it_is(builder: Any) -> None:
        """Code that is none, of which the compiler does not know that: it leaves the loop around it alone."""
        nothing = ir.InlineAsm(ir.FunctionType(ir.VoidType(), []), "", "", side_effect=True)
        call = builder.call(nothing, [])
        call.attributes.add("nounwind")
        call.attributes.add("readnone")

    @intrinsic
    def few(typingctx: Any) -> Any:
        """Says in a loop that it has few turns."""

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            left_as_it_is(builder)
            return context.get_dummy_value()

        return types.void(), generate

else:

    def few() -> None:
        """Nothing."""


@inlined
def put(source: Any, out: Any) -> None:
    """Copy an array; a slice assignment takes ten times as long for a few numbers."""
    for i in range(source.shape[0]):
        few()
        out[i] = source[i]


@inlined
def fill(out: Any, value: Any) -> None:
    """Write one value to all of an array."""
    for i in range(out.shape[0]):
        few()
        out[i] = value
