"""This module multiplies small matrices and vectors in compiled code, four numbers at a time.

A matrix is stored in blocks of four rows, or row by row for single rows. Vectors are padded with zeros up to
the next multiple of four, and so are the columns that they multiply.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hybridsim.engine.native.inner_parts import needed
from hybridsim.engine.native.kernels import ENABLED, inlined
from hybridsim.engine.native.loop_hints import short_loop

LANES = 4  # rows of a panel, and columns processed at once


def filled_up(count: int) -> int:
    """Round a count up to the next multiple of four."""
    return -(-count // LANES) * LANES


def vector_of(count: int) -> np.ndarray:
    """Allocate a vector of a given length, padded with zeros."""
    return np.zeros(filled_up(count))[:count]


def rows_of(matrix: np.ndarray, parts: Sequence[int] = ()) -> np.ndarray:
    """Pad groups of columns of matrices (..., rows, columns) with zeros; `parts` contains the widths of the groups."""
    parts = parts or (matrix.shape[-1],)
    out = np.zeros((*matrix.shape[:-1], sum(map(filled_up, parts))))
    source = target = 0
    for part in parts:
        out[..., target : target + part] = matrix[..., source : source + part]
        source, target = source + part, target + filled_up(part)
    return out


def row_blocks_of(matrix: np.ndarray, parts: Sequence[int] = ()) -> np.ndarray:
    """Arrange matrices (..., rows, columns) in blocks (..., rows/4, columns, 4), padded with zeros."""
    wide = rows_of(matrix, parts)
    *lead, rows, columns = wide.shape
    out = np.zeros((*lead, filled_up(rows), columns))
    out[..., :rows, :] = wide
    return np.ascontiguousarray(np.swapaxes(out.reshape(*lead, -1, LANES, columns), -1, -2))


if ENABLED:
    from llvmlite import ir
    from numba import types
    from numba.extending import intrinsic

    from hybridsim.engine.native.loop_hints import left_as_it_is

    cgutils = needed("cgutils")
    _WORD, _DOUBLE, _BYTES = ir.IntType(64), ir.DoubleType(), 8
    _FOUR = ir.VectorType(_DOUBLE, LANES)
    _NOTHING, _FIRST = ir.Constant(_FOUR, ir.Undefined), ir.IntType(32)(0)
    _ALL_FIRST = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    _ZERO = ir.Constant(_FOUR, [0.0] * LANES)

    def _loaded(builder: Any, base: Any, offset: int, kind: Any) -> Any:
        place = builder.gep(base, [_WORD(offset)])
        return builder.load(builder.bitcast(place, kind.as_pointer()), align=_BYTES)

    def _address(context: Any, builder: Any, kind: Any, value: Any, at: Any, numbers: Any) -> Any:
        """Return the address of the subarray that leading indices select."""
        array = context.make_array(kind)(context, builder, value)
        place = builder.bitcast(array.data, ir.IntType(8).as_pointer())
        strides = cgutils.unpack_tuple(builder, array.strides, kind.ndim)
        for number, index, stride in zip(numbers, at.types, strides, strict=False):
            number = context.cast(builder, number, index, types.int64)
            place = builder.gep(place, [builder.mul(number, stride)])
        return builder.bitcast(place, _DOUBLE.as_pointer())

    def _over_fours(
        context: Any, builder: Any, kind: Any, value: Any, row: Any, wide: int, body: Any, sums: Any
    ) -> Any:
        """Emit a loop that accumulates sums over a vector, four entries at a time.

        row: address of the matrix elements that belong to the start of the vector. wide: matrix elements per
        entry. body(entries, row, sums) returns the next sums. Return the sums and the row address for the
        next vector.
        """
        array = context.make_array(kind)(context, builder, value)
        (count,) = cgutils.unpack_tuple(builder, array.shape, 1)
        if kind.dtype == types.complex128:
            count = builder.add(count, count)
        turns = builder.lshr(builder.add(count, _WORD(LANES - 1)), _WORD(2))
        first = builder.bitcast(array.data, _DOUBLE.as_pointer())
        before = builder.block
        head, out = (builder.function.append_basic_block(name) for name in ("fours", "fours.out"))
        builder.cbranch(builder.icmp_signed(">", turns, _WORD(0)), head, out)
        builder.position_at_end(head)
        turn, *now = [builder.phi(kind) for kind in (_WORD, *(s.type for s in sums))]
        left_as_it_is(builder)
        at = builder.mul(turn, _WORD(LANES))
        following = body(builder.gep(first, [at]), builder.gep(row, [builder.mul(at, _WORD(wide))]), now)
        ahead = builder.add(turn, _WORD(1))
        builder.cbranch(builder.icmp_signed("<", ahead, turns), head, out)
        for phi, start, later in zip((turn, *now), (_WORD(0), *sums), (ahead, *following), strict=True):
            phi.add_incoming(start, before)
            phi.add_incoming(later, head)
        builder.position_at_end(out)
        after = [builder.phi(s.type) for s in sums]
        for phi, start, later in zip(after, sums, following, strict=True):
            phi.add_incoming(start, before)
            phi.add_incoming(later, head)
        return after, builder.gep(row, [builder.mul(turns, _WORD(LANES * wide))])

    @intrinsic
    def times(typingctx: Any, row_blocks: Any, at: Any, vectors: Any) -> Any:
        """Multiply a block of four rows by several concatenated vectors; `at` is the index of the block."""
        result = types.UniTuple(types.float64, LANES)

        def body(builder: Any, entries: Any, rows: Any, sums: Any) -> Any:
            sums = list(sums)
            for i in range(LANES):
                entry = builder.insert_element(_NOTHING, _loaded(builder, entries, i, _DOUBLE), _FIRST)
                entry = builder.shuffle_vector(entry, _NOTHING, _ALL_FIRST)
                product = builder.fmul(_loaded(builder, rows, i * LANES, _FOUR), entry, flags=("contract",))
                sums[i % 2] = builder.fadd(sums[i % 2], product, flags=("contract",))
            return sums

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            place = _address(
                context,
                builder,
                row_blocks,
                arguments[0],
                at,
                cgutils.unpack_tuple(builder, arguments[1], len(at)),
            )
            sums = [_ZERO, _ZERO]
            parts = cgutils.unpack_tuple(builder, arguments[2], len(vectors))
            for part, kind in zip(parts, vectors.types, strict=True):
                sums, place = _over_fours(
                    context, builder, kind, part, place, LANES, lambda *a: body(builder, *a), sums
                )
            total = builder.fadd(*sums)
            lanes = [builder.extract_element(total, ir.IntType(32)(i)) for i in range(LANES)]
            return context.make_tuple(builder, result, lanes)

        return result(row_blocks, at, vectors), generate

    @intrinsic
    def dot(typingctx: Any, rows: Any, at: Any, vectors: Any) -> Any:
        """Multiply one row by several concatenated vectors; `at` is the index of the row."""

        def body(builder: Any, entries: Any, row: Any, sums: Any) -> Any:
            four, other = _loaded(builder, entries, 0, _FOUR), _loaded(builder, row, 0, _FOUR)
            product = builder.fmul(four, other, flags=("contract",))
            return [builder.fadd(sums[0], product, flags=("contract",))]

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            place = _address(
                context, builder, rows, arguments[0], at, cgutils.unpack_tuple(builder, arguments[1], len(at))
            )
            sums = [_ZERO]
            parts = cgutils.unpack_tuple(builder, arguments[2], len(vectors))
            for part, kind in zip(parts, vectors.types, strict=True):
                sums, place = _over_fours(
                    context, builder, kind, part, place, 1, lambda *a: body(builder, *a), sums
                )
            lanes = [builder.extract_element(sums[0], ir.IntType(32)(i)) for i in range(LANES)]
            return builder.fadd(builder.fadd(lanes[0], lanes[2]), builder.fadd(lanes[1], lanes[3]))

        return types.float64(rows, at, vectors), generate

else:

    def _entries(vectors: tuple[Any, ...]) -> np.ndarray:
        return rows_of(
            np.concatenate([v.view(float) for v in vectors]), [v.view(float).size for v in vectors]
        )

    def times(row_blocks: Any, at: tuple[int, ...], vectors: tuple[Any, ...]) -> tuple[float, ...]:
        """Multiply a block of four matrix rows by several vectors in a row."""
        entries = _entries(vectors)
        return tuple((entries @ row_blocks[at][: len(entries)]).tolist())

    def dot(rows: Any, at: tuple[int, ...], vectors: tuple[Any, ...]) -> float:
        """Multiply one row by several concatenated vectors."""
        entries = _entries(vectors)
        return float(entries @ rows[at][: len(entries)])


@inlined
def product(row_blocks: Any, k: int, vectors: Any, out: Any) -> None:
    """Multiply matrix `k` of an array (K, Q, m, 4) by several concatenated vectors."""
    i = 0
    while i < out.shape[0]:
        short_loop()
        a, b, c, d = times(row_blocks, (k, i // LANES), vectors)
        out[i] = a
        if i + 1 < out.shape[0]:
            out[i + 1] = b
        if i + 2 < out.shape[0]:
            out[i + 2] = c
        if i + 3 < out.shape[0]:
            out[i + 3] = d
        i += LANES
