"""Arrays behind one pointer: what a kernel reads and writes through a layout is what its rows hold."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest

from hybridsim.engine.native.array_layout import ArrayLayout, BufferPool, release
from hybridsim.engine.native.kernels import ENABLED, Precompiled, kernel
from hybridsim.engine.native.struct_pack import packed


class Rows(NamedTuple):
    """Three arrays of rows."""

    numbers: np.ndarray
    words: np.ndarray
    waves: np.ndarray


FIELDS = ((float, (5, 2), 0), (np.int64, (6,), 1), (complex, (5, 0), 0))


@kernel
def _number(rows: Any) -> int:
    """Write numbers that count up, and give the count of words."""
    count = 0.0
    for i in range(rows.numbers.shape[0]):
        for j in range(rows.numbers.shape[1]):
            rows.numbers[i, j] = count
            count += 1.0
    for i in range(rows.words.shape[0]):
        rows.words[i] = 10 + i
    return rows.words.shape[0] + 100 * rows.waves.shape[0]


@pytest.mark.parametrize("first", [(0, 0, 0), (2, 1, 5)])
def test_a_kernel_writes_to_the_rows_of_a_layout(first: tuple[int, ...]) -> None:
    array_layout = ArrayLayout((Rows,), FIELDS)
    blocks = array_layout.blank()
    rows = array_layout.rows(blocks)
    rows.numbers[:], rows.words[:] = -1.0, -1
    assert _number(*array_layout.packed(blocks, first)) == 6 - first[1] + 100 * (5 - first[2])
    assert rows.numbers[first[0] :].ravel().tolist() == list(range(10 - 2 * first[0]))
    assert rows.words[first[1] :].tolist() == list(range(10, 16 - first[1]))
    assert (rows.numbers[: first[0]] == -1.0).all() and (rows.words[: first[1]] == -1).all()


def test_arrays_of_different_blocks_do_not_hold_each_other() -> None:
    array_layout = ArrayLayout((Rows,), FIELDS)
    rows = array_layout.rows(array_layout.blank())
    assert not np.shares_memory(rows.numbers, rows.words)
    assert rows.numbers.base is not rows.words.base
    assert all(array.flags.c_contiguous and array.flags.aligned for array in rows)


@pytest.mark.parametrize(
    "view", [lambda a: a, lambda a: a[3:], lambda a: a.view(float).reshape(2, -1).T, memoryview]
)
def test_memory_is_handed_on_once_nobody_holds_it(view: Callable[[np.ndarray], Any]) -> None:
    pool = BufferPool(1 << 12)
    block = pool.block()
    block[:] = 1
    place, held = block.ctypes.data, view(block)
    before = bytes(held)
    del block
    other = pool.block()
    other[:] = 2
    assert other.ctypes.data != place
    assert bytes(held) == before
    del held
    assert pool.block().ctypes.data == place


def test_large_layouts_take_such_memory() -> None:
    array_layout = ArrayLayout((Rows,), ((float, (1 << 15, 2), 0), (np.int64, (6,), 1), (complex, (5, 0), 0)))
    numbers = array_layout.rows(array_layout.blank()).numbers
    numbers[:] = 1.0
    place = numbers.ctypes.data
    last = numbers[-1:]
    del numbers
    array_layout.rows(array_layout.blank()).numbers[:] = 2.0
    assert array_layout.blank()[0].ctypes.data != place
    assert last.tolist() == [[1.0, 1.0]]
    del last
    assert array_layout.blank()[0].ctypes.data == place


def test_a_precompiled_kernel_is_the_same_kernel() -> None:
    arrays = Rows(np.zeros((2, 2)), np.zeros(3, dtype=np.int64), np.zeros((1, 0), dtype=complex))
    precompiled = Precompiled(_number)
    assert [precompiled(packed(arrays)), precompiled(packed(arrays))] == [103, 103]
    assert arrays.numbers.tolist() == [[0.0, 1.0], [2.0, 3.0]]


@pytest.mark.skipif(not ENABLED, reason="without the compiler arrays are no packs")
def test_arrays_that_are_released_are_the_next_zeros() -> None:
    array_layout = ArrayLayout((Rows,), [(dtype, shape, 0) for dtype, shape, _ in FIELDS])
    first = array_layout.zeros()
    assert _number(first) == 506
    assert first.words.tolist() == [10, 11, 12, 13, 14, 15]
    release(first)
    again, other = array_layout.zeros(), array_layout.zeros()
    assert again.address == first.address != other.address
    assert not again.numbers.any() and not again.words.any() and not other.numbers.any()


def test_a_block_that_is_taken_back_is_the_next_one() -> None:
    array_layout = ArrayLayout((Rows,), FIELDS)
    first, _ = array_layout.blank()
    assert array_layout.blank()[0] is not first
    array_layout.take_back(first)
    assert array_layout.blank()[0] is first
    assert array_layout.blank()[0] is not first
