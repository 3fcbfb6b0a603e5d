"""Large blocks of memory, handed on to the next who asks once nobody holds them.

A fresh block of such a size the system gives page by page, as it is first written to: inside of a compiled loop that
costs as much as a sixth of a run of thousands of steps.
"""

from __future__ import annotations

import ctypes
import weakref

import numpy as np

_KEPT = 4  # free blocks of one size


class Lender:
    """Blocks of one size in bytes.

    What is lent is a buffer of its own over the memory. Every array over it, and every view of one, holds that buffer,
    whatever NumPy makes of chains of views; when it goes, the memory is free again.
    """

    def __init__(self, size: int) -> None:
        self.size, self._kind = size, ctypes.c_char * size
        self._free: list[bytearray] = []

    def block(self) -> np.ndarray:
        """A block, with whatever was written there before."""
        try:
            memory = self._free.pop()
        except IndexError:
            memory = bytearray(self.size)
        lent = self._kind.from_buffer(memory)
        weakref.finalize(lent, self._take_back, memory).atexit = False
        return np.frombuffer(memoryview(lent), dtype=np.uint8)

    def _take_back(self, memory: bytearray) -> None:
        if len(self._free) < _KEPT:
            self._free.append(memory)
