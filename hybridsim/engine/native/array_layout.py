"""This module stores the arrays that kernels write in a few blocks of memory."""

from __future__ import annotations

import ctypes
import math
from collections import namedtuple
from collections.abc import Sequence
from itertools import islice
from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import ENABLED, Precompiled, kernel
from hybridsim.engine.native.struct_pack import SLOTS_PER_ARRAY

if ENABLED:
    from hybridsim.engine.native.struct_pack import Packed, type_of_fields

    class LayoutPack(Packed):
        """The arrays of a layout as one pack; each array is made when it is first read in Python."""

        def __init__(
            self,
            layout: ArrayLayout,
            blocks: tuple[np.ndarray, ...],
            table: np.ndarray,
            kind: Any,
            address: int,
        ) -> None:
            self.table, self.numba_type, self.address = table, kind, address
            self._layout, self._blocks = layout, blocks

        def __getattr__(self, name: str) -> np.ndarray:
            if name.startswith("_") or name not in self._layout:
                raise AttributeError(name)
            array = self._layout.array(self._blocks, name)
            setattr(self, name, array)
            return array


def release(pack: Any) -> None:
    """Give the arrays of a pack back to their layout for reuse; the caller must not use them any more."""
    if ENABLED:
        pack._layout.take_back_pack(pack)


ALIGNED = 64  # bytes; suitable for numbers of any kind
_LARGE, LARGEST = 1 << 18, 1 << 21  # bytes of blocks that go through a pool
_RETURNED = 2  # first blocks that a layout keeps for reuse
_MAX_FREE_BLOCKS = 4  # most free blocks in a pool


@kernel
def _lay_out(entries: Any, steps: Any, owners: Any, skipped: Any, blocks: Any, table: Any) -> int:
    """Write the addresses and shapes of the arrays to a table, and return the address of the table."""
    for k in range(entries.shape[0]):
        for i in range(entries.shape[1]):
            table[k, i] = entries[k, i] + skipped[k] * steps[k, i]
        table[k, 0] += blocks[owners[k]].ctypes.data
    address: int = table.ctypes.data
    return address


class ArrayLayout:
    """A layout of arrays that follow each other in a few blocks of memory.

    Offsets are computed once; a new block is a single allocation, and packing all arrays takes a few
    additions. A block is freed with the last array in it, so arrays with different lifetimes belong in
    different blocks.

    Parameters
    ----------
    kinds : types of named tuples, whose arrays lie one behind the other.
    fields : dtype, shape and block number of each array.
    """

    def __init__(self, kinds: Sequence[Any], fields: Sequence[tuple[Any, tuple[int, ...], int]]) -> None:
        self._kinds = [(kind, len(kind._fields)) for kind in kinds]
        names = [name for kind in kinds for name in kind._fields]
        self._kind: Any = namedtuple("Rows", names)  # type: ignore[misc]  # names known at run time
        self._specs: dict[str, tuple[tuple[int, ...], np.dtype[Any], int, int]] = {}
        self._sizes = [0] * (1 + max(block for *_, block in fields))
        # the table without the addresses of the blocks
        self._entries = np.zeros((len(fields), SLOTS_PER_ARRAY), dtype=np.int64)
        self._steps = np.zeros_like(self._entries)  # change of the table per skipped row
        self._owners = np.array([block for *_, block in fields], dtype=np.int64)
        for k, (name, (scalar, shape, block)) in enumerate(zip(names, fields, strict=True)):
            dtype, offset = np.dtype(scalar), self._sizes[block]
            row = dtype.itemsize * math.prod(shape[1:])
            self._specs[name] = shape, dtype, block, offset
            self._entries[k, : 1 + len(shape)] = offset, *shape
            self._steps[k, :2] = row, -1
            self._sizes[block] += -(-row * shape[0] // ALIGNED) * ALIGNED
        self._pools = [BufferPool(size) if _LARGE <= size <= LARGEST else None for size in self._sizes]
        form = [(dtype.char, len(shape)) for shape, dtype, *_ in self._specs.values()]
        self._types: list[
            tuple[Any, int]
        ] = []  # the type of each pack, and the bytes of its part of the table
        for kind, count in self._kinds if ENABLED else ():
            self._types.append((type_of_fields(kind, tuple(form[:count])), 8 * SLOTS_PER_ARRAY * count))
            del form[:count]
        self._returned: list[np.ndarray] = []
        self._released: list[Any] = []  # packs
        self._from_the_first = np.zeros(len(fields), dtype=np.int64)
        self._lay_out, self._lay_out_rest = Precompiled(_lay_out), Precompiled(_lay_out)  # of as many blocks

    def blank(self) -> tuple[np.ndarray, ...]:
        """Return new uninitialised blocks."""
        try:
            first = self._returned.pop()
        except IndexError:  # another thread may take the last one after a test
            first = self._block(0)
        return first, *map(self._block, range(1, len(self._sizes)))

    def _block(self, k: int) -> np.ndarray:
        pool = self._pools[k]
        return np.empty(self._sizes[k], dtype=np.uint8) if pool is None else pool.block()

    def take_back(self, block: np.ndarray) -> None:
        """Take back a memory block that is no longer used, for the next call."""
        if len(self._returned) < _RETURNED:
            self._returned.append(block)

    def packed(self, blocks: tuple[np.ndarray, ...], skipped: tuple[int, ...]) -> list[Any]:
        """Return each named tuple of arrays as a pack; `skipped` is the number of rows to omit from each array."""
        packs: list[Any] = []
        if not ENABLED:
            arrays = iter(zip(self.rows(blocks), skipped, strict=True))
            for kind, count in self._kinds:
                packs.append(kind(*(a[k:] for a, k in islice(arrays, count))))
            return packs
        table = np.empty_like(self._entries)
        address = self._lay_out_rest(self._entries, self._steps, self._owners, skipped, blocks, table)
        for form, size in self._types:
            packs.append(Packed(None, table, form, address))
            address += size
        return packs

    def zeros(self) -> Any:
        """Return arrays of zeros as a pack; this requires a layout of one named tuple in one block."""
        try:
            pack = self._released.pop()
            pack._blocks[0].fill(0)
            return pack
        except IndexError:  # there is none
            blocks = (self._block(0),)
        blocks[0].fill(0)
        if not ENABLED:
            return self._kinds[0][0](*self.rows(blocks))
        table = np.empty_like(self._entries)
        address = self._lay_out(self._entries, self._steps, self._owners, self._from_the_first, blocks, table)
        return LayoutPack(self, blocks, table, self._types[0][0], address)

    def take_back_pack(self, pack: Any) -> None:
        """Store the arrays of a released pack for reuse, if they are small."""
        if len(self._released) < _RETURNED and self._sizes[0] < _LARGE:
            self._released.append(pack)

    def __contains__(self, name: str) -> bool:
        return name in self._specs

    @property
    def size(self) -> int:
        """Return the size of all blocks in bytes."""
        return sum(self._sizes)

    def rows(self, blocks: tuple[np.ndarray | None, ...]) -> Any:
        """Return the arrays in some memory blocks; an array whose block is missing is None."""
        return self._kind(
            *[
                None if blocks[k] is None else np.ndarray(shape, dtype, blocks[k], offset)
                for shape, dtype, k, offset in self._specs.values()
            ]
        )

    def array(self, blocks: tuple[np.ndarray | None, ...], name: str) -> np.ndarray:
        """Return the array with the given name, whose block must not be missing."""
        shape, dtype, k, offset = self._specs[name]
        return np.ndarray(shape, dtype, blocks[k], offset)


class BufferPool:
    """A pool of memory blocks of one size; a block is reused when no array uses it any more.

    The operating system maps a fresh block page by page, when it is first written. In a compiled loop this can cost a
    sixth of the time of a run of thousands of steps.

    Each block is handed out as a buffer object over its memory. Every array over the buffer, and every view of such
    an array, keeps the buffer alive. The memory returns to the pool when the buffer is deleted.
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self._free: list[bytearray] = []
        self._kind = _buffer_type(size, self._free)

    def block(self) -> np.ndarray:
        """Return a block with undefined contents."""
        try:
            memory = self._free.pop()
        except IndexError:
            memory = bytearray(self.size)
        buffer = self._kind.from_buffer(memory)
        buffer.memory = memory
        return np.frombuffer(memoryview(buffer), dtype=np.uint8)


def _buffer_type(size: int, free: list[bytearray]) -> Any:
    """Return a buffer type of a given size; its instances return their memory to the pool."""

    class PooledBuffer(ctypes.c_char * size):  # type: ignore[misc]  # the size is known at run time
        memory: bytearray

        def __del__(
            self, limit: int = _MAX_FREE_BLOCKS
        ) -> None:  # globals may be gone while Python shuts down
            if len(free) < limit:
                free.append(self.memory)

    return PooledBuffer
