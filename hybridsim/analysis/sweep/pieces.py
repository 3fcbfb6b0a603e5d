"""Cuts the points of a sweep into pieces of work: long enough to be worth sending, short enough to share."""

from __future__ import annotations

import math

import numpy as np

# Seconds of a piece: a thousand times what it costs to send one, and still ten a second for whoever watches.
_LENGTH = 0.1


class Pieces:
    """Hands out ranges of points.

    Parameters
    ----------
    total : number of points.
    chains : number of chains, each of which is one piece; None where no point needs its neighbour. The points of
        chain c are c, c + chains, c + 2 chains, ...: the first axis of a grid, at the same place on all others.
    workers : among whom they are shared.
    done : which points (total,) are done already; a chain is begun anew unless all of it is.
    """

    def __init__(self, total: int, chains: int | None, workers: int, done: np.ndarray | None = None) -> None:
        self._total, self._chains, self._workers = total, chains, workers
        self._next, self._size = 0, 1
        self._open = np.arange(total + 1) if done is None else np.append(np.flatnonzero(~done), total)

    def next(self) -> range | None:
        """The next piece; None when all are handed out."""
        start = self._next
        if self._chains is not None:
            while start < self._chains and not (self._open[:-1] % self._chains == start).any():
                start += 1
            self._next = start + 1
            return range(start, self._total, self._chains) if start < self._chains else None
        left = len(self._open) - 1 - start
        if left <= 0:
            return None
        # the last pieces are small, so that nobody waits long for another
        size = min(self._size, math.ceil(left / (2 * self._workers)))
        first = int(self._open[start])
        while self._open[start + size - 1] != first + size - 1:  # points in a row
            size -= 1
        self._next += size
        return range(first, first + size)

    def learn(self, points: int, seconds: float) -> None:
        """Take notice of how long some points took."""
        fitting = int(_LENGTH * points / seconds) if seconds > 0 else 2 * points
        self._size = max(1, min(fitting, 2 * points if points >= self._size else self._size))
