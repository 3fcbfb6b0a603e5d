"""Large blocks of memory, handed on to the next who asks once nobody holds them.

A fresh block of such a size the system gives page by page, as it is first written to: inside of a compiled loop that
costs as much as a sixth of a run of thousands of steps.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

_KEPT = 4  # free blocks of one size


class Lender:
    """Blocks of one size in bytes.

    What is lent is a buffer of its own over the memory. Every array over it, and every view of one, holds that buffer,
    whatever NumPy makes of chains of views; when it goes, the memory is free again.
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self._free: list[bytearray] = []
        self._kind = _lent(size, self._free)

    def block(self) -> np.ndarray:
        """A block, with whatever was written there before."""
        try:
            memory = self._free.pop()
        except IndexError:
            memory = bytearray(self.size)
        lent = self._kind.from_buffer(memory)
        lent.memory = memory
        return np.frombuffer(memoryview(lent), dtype=np.uint8)


def _lent(size: int, free: list[bytearray]) -> Any:
    """A type of buffers over so many bytes, which give their memory back when they go."""

    class Lent(ctypes.c_char * size):  # type: ignore[misc]  # made when it is needed
        memory: bytearray

        def __del__(self, kept: int = _KEPT) -> None:  # at the end of Python globals may be gone
            if len(free) < kept:
                free.append(self.memory)

    return Lent
