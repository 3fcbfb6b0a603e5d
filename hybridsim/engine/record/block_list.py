"""This module stores all segments and all events of a run in blocks, and discards old blocks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, TypeVar, overload

import numpy as np

from hybridsim.engine.record.blocks import Block, SegmentList
from hybridsim.engine.record.checkpoint import damaged
from hybridsim.engine.record.segments import Segment
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System

Item = TypeVar("Item")

_LOOSE = 16  # items in a list that is discarded as a whole


class BlockList(Sequence[Item]):
    """All segments or all events of a run in order, in blocks.

    Parameters
    ----------
    loose : makes an empty list for single items; such a list is a block as well.
    window : how long back, in the unit of t, items are kept. Older blocks are discarded as newer ones arrive, except
    the
        last block. With None nothing is kept except the `least`.
    least : number of last items that are kept regardless of their age.
    """

    def __init__(self, loose: Callable[[], Any], window: float | None = math.inf, least: int = 0) -> None:
        self.blocks: list[Any] = []
        self._loose, self.window, self._least = loose, window, least
        self.forgotten = 0  # number of discarded blocks

    def append(self, item: Item) -> None:
        """Add one segment or event."""
        if self.window is None and not self._least:
            return
        limit = math.inf if self.window == math.inf else max(_LOOSE, self._least // 4)
        last = self.blocks[-1] if self.blocks else None
        if not isinstance(last, list) or len(last) >= limit:
            self.blocks.append(last := self._loose())
        last.append(item)
        self._forget()

    def extend(self, items: Iterable[Item]) -> None:
        """Add several segments or events."""
        for item in items:
            self.append(item)

    def add(self, block: Block[Item]) -> None:
        """Add a block of segments or events."""
        if (self.window is not None or self._least) and len(block):
            self.blocks.append(block)
            if len(self.blocks) > 1:
                self._forget()

    def _forget(self) -> None:
        """Discard the blocks that end before the stored part of the run."""
        if self.window == math.inf or len(self.blocks) == 1:
            return
        now, window, spare = self.blocks[-1].until, self.window or 0.0, len(self) - self._least
        while len(self.blocks) > 1 and abs(now.minus(self.blocks[0].until)) > window:
            spare -= len(self.blocks[0])
            if spare < 0:
                return
            del self.blocks[0]
            self.forgotten += 1

    def set_end(self, item: Item) -> None:
        """Replace all stored segments or events by one."""
        self.forgotten += len(self.blocks)
        last = self._loose()
        last.append(item)
        self.blocks = [last]

    def drop(self, count: int) -> None:
        """Discard a number of segments or events at the start."""
        while self.blocks and count >= len(self.blocks[0]):
            count -= len(self.blocks.pop(0))
        if count:
            self.blocks[0] = self.blocks[0].since(count)

    def mark(self) -> tuple[int, int]:
        """Return the present end of the list, for a later call of `since_mark`."""
        blocks = self.blocks
        return self.forgotten + len(blocks), len(blocks[-1]) if blocks else 0

    def since_mark(self, mark: tuple[int, int]) -> int:
        """Return how many segments or events were added after a mark."""
        number, length = mark[0] - self.forgotten, mark[1]
        rest = len(self.blocks[number - 1]) - length if number > 0 else 0
        return rest + sum(map(len, self.blocks[max(number, 0) :]))

    def without_last(self, count: int) -> list[Any]:
        """Return a copy of the list without its last `count` segments or events."""
        blocks = list(self.blocks)
        while blocks and count >= len(blocks[-1]):
            count -= len(blocks.pop())
        if (
            blocks and count and not isinstance(blocks[-1], list)
        ):  # a run can continue only at the end of a block of arrays
            raise damaged("the number of stored segments or events is wrong")
        if blocks and isinstance(blocks[-1], list):
            last = self._loose()
            last.extend(blocks[-1][: len(blocks[-1]) - count])
            blocks[-1] = last
        return blocks

    def starts(self) -> np.ndarray:
        """Return the index of the first segment or event of each block, followed by the total number."""
        return np.cumsum([0, *map(len, self.blocks)])

    def __bool__(self) -> bool:
        return bool(self.blocks)  # no block is empty

    def __len__(self) -> int:
        return sum(map(len, self.blocks))

    def __iter__(self) -> Iterator[Item]:
        for block in self.blocks:
            yield from block

    @overload
    def __getitem__(self, i: int, /) -> Item: ...
    @overload
    def __getitem__(self, i: slice, /) -> list[Item]: ...
    def __getitem__(self, i: int | slice, /) -> Item | list[Item]:
        count = len(self)
        if isinstance(i, slice):
            return [self[k] for k in range(*i.indices(count))]
        place = i + count if i < 0 else i
        if not 0 <= place < count:
            raise IndexError(f"item {i} is out of range of {count} items")
        for block in self.blocks:
            if place < len(block):
                return block[place]
            place -= len(block)
        raise AssertionError("the blocks contain fewer items than the sum of their lengths")


class SegmentBlockList(BlockList[Segment]):
    """All segments of a run."""

    def __init__(self, system: System, window: float | None = math.inf) -> None:
        super().__init__(lambda: SegmentList(system), window)
        self._shape = (system.n, len(system.automata))

    def origins(self) -> np.ndarray:
        """Return the origin of local time of each segment (N, 2)."""
        return _joined([block.origins for block in self.blocks])

    def spans(self) -> np.ndarray:
        """Return the first and last local time of each segment (N, 2)."""
        return _joined([block.spans for block in self.blocks])

    def modes(self) -> np.ndarray:
        """Return the modes of each segment (N, C)."""
        none = np.empty((0, self._shape[1]), dtype=np.int64)
        return np.concatenate([none, *(block.modes for block in self.blocks)])

    @property
    def is_end_alone(self) -> bool:
        """Return whether only the end of the run is stored."""
        return self.window == 0.0

    def drop_all_but_end(self) -> None:
        """Replace all segments by the end of the last segment, unless this has been done already."""
        last = self.blocks[-1]
        if len(self.blocks) > 1 or len(last) > 1 or not isinstance(last, list) or len(last[0].s) > 1:
            self.set_end(last.at_end())

    def cut(self, instant: Instant) -> None:
        """Discard all results before an instant, including the first part of the segment at this instant."""
        origins, spans = self.origins(), self.spans()
        moved = (origins[:, 0] - instant.high) + (origins[:, 1] - instant.low) + spans[:, 0]
        sign = 1.0 if spans[-1, 1] >= spans[-1, 0] else -1.0
        first = max(int(np.searchsorted(sign * moved, 0.0, side="right")) - 1, 0)
        self.drop(first)
        held, s = self[0], instant.minus(Instant(*origins[first].tolist()))
        if sign * s <= sign * held.s[0]:
            return
        x = self.states(np.array([0]), np.array([s]))
        later = sign * held.s > sign * s
        knots, states = np.append(s, held.s[later]), np.concatenate([x, held.x[later]])
        self.drop(1)
        head = self._loose()
        head.append(Segment(held.origin, held.z, held.p, knots, states, held.dense))
        self.blocks.insert(0, head)

    def states(self, index: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return states (k, n) at local times (k,) in the segments with the given numbers."""
        if len(self.blocks) == 1:
            return self.blocks[0].states(index, s)
        starts = self.starts()
        owner = np.searchsorted(starts, index, side="right") - 1
        out = np.empty((len(s), self._shape[0]))
        order = np.argsort(owner, kind="stable")
        found, first = np.unique(owner[order], return_index=True)
        for b, chosen in zip(found.tolist(), np.split(order, first)[1:], strict=True):
            out[chosen] = self.blocks[b].states(index[chosen] - starts[b], s[chosen])
        return out

    def knots(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the steps of the run: segment numbers (m,), local times (m,) and states (m, n)."""
        index, s, x = [np.empty(0, dtype=np.int64)], [np.empty(0)], [np.empty((0, self._shape[0]))]
        for block, start in zip(self.blocks, self.starts().tolist(), strict=False):
            numbers, times, states = block.knots()
            index.append(numbers + start)
            s.append(times)
            x.append(states)
        return np.concatenate(index), np.concatenate(s), np.concatenate(x)


def _joined(pairs: list[np.ndarray]) -> np.ndarray:
    """Return the pairs of numbers of all blocks as one array (N, 2)."""
    return pairs[0] if len(pairs) == 1 else np.concatenate([np.empty((0, 2)), *pairs])
