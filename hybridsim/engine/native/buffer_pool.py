"""A pool of large memory blocks, each of which is reused when all arrays in it have been deleted.

The operating system maps a fresh block of this size page by page, when it is first written. In a compiled
loop this can cost a sixth of the time of a run of thousands of steps.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

_MAX_FREE_BLOCKS = 4  # most free blocks in a pool


class BufferPool:
    """A pool of blocks of one size in bytes.

    Each block is handed out as a buffer object over its memory. Every array over the buffer, and every view of such
    an array, keeps the buffer alive. The memory returns to the pool when the buffer is deleted.
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self._free: list[bytearray] = []
        self._kind = _buffer_type(size, self._free)

    def block(self) -> np.ndarray:
        """Return a block; its contents are undefined."""
        try:
            memory = self._free.pop()
        except IndexError:
            memory = bytearray(self.size)
        buffer = self._kind.from_buffer(memory)
        buffer.memory = memory
        return np.frombuffer(memoryview(buffer), dtype=np.uint8)


def _buffer_type(size: int, free: list[bytearray]) -> Any:
    """Return a buffer type of a size in bytes whose instances return their memory to the pool when deleted."""

    class PooledBuffer(ctypes.c_char * size):  # type: ignore[misc]  # the size is known at run time
        memory: bytearray

        def __del__(
            self, limit: int = _MAX_FREE_BLOCKS
        ) -> None:  # globals may be gone while Python shuts down
            if len(free) < limit:
                free.append(self.memory)

    return PooledBuffer
