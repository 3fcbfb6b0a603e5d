"""This module stores arrays that grow by rows: adding rows copies the earlier ones only when the memory is full.

Arrays that were returned before keep their values. They are views of the same memory or of an earlier one.
"""

from __future__ import annotations

from typing import Any

import numpy as np


class GrowingArray:
    """An array of rows of one shape, whose memory doubles when it is full."""

    def __init__(self, shape: tuple[int, ...] = (), dtype: Any = np.int64) -> None:
        self._memory = np.zeros((0, *shape), dtype=dtype)

    def put(self, first: int, rows: Any) -> None:
        """Write rows after the first `first` rows."""
        end = first + len(rows)
        if end > len(self._memory):
            memory = np.zeros((2 * end, *self._memory.shape[1:]), dtype=self._memory.dtype)
            memory[:first] = self._memory[:first]
            self._memory = memory
        self._memory[first:end] = rows

    def up_to(self, count: int) -> np.ndarray:
        """Return the first `count` rows."""
        return self._memory[:count]


class GrowingLists:
    """Lists of rows in one array, with the start of each list."""

    def __init__(self, shape: tuple[int, ...] = (5,)) -> None:
        self._starts, self._rows = GrowingArray(), GrowingArray(shape)
        self._starts.put(0, [0])

    def put(self, k: int, rows: Any) -> None:
        """Append list k after all earlier lists, and store where the next list starts."""
        first = int(self._starts.up_to(k + 1)[k])
        self._rows.put(first, rows)
        self._starts.put(k + 1, [first + len(rows)])

    def up_to(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the starts and the rows of the first `count` lists."""
        starts = self._starts.up_to(count + 1)
        return starts, self._rows.up_to(starts[count])
