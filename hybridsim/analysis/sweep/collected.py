"""This module collects the results of a sweep in arrays; the results may arrive in any order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hybridsim.analysis.sweep.readings import Reading
from hybridsim.analysis.sweep.work.job import NOT_RUN, Outcome


class Collected:
    """Arrays of results and statuses, which do not depend on the order of arrival.

    A reading that a point does not have is NaN, or an empty text. The end of an array that is shorter than
    another point's is filled in the same way.
    """

    def __init__(self, total: int) -> None:
        self.status = np.full(total, NOT_RUN, dtype=object)
        self.done = self.one_by_one = 0
        self._arrays: dict[str, np.ndarray] = {}
        self._first_positions: dict[
            str, tuple[int, int]
        ] = {}  # for each name: the first point that has it, and the position there

    def put(self, numbers: Sequence[int], outcomes: Sequence[Outcome]) -> None:
        """Store the outcomes of some points. Points without an outcome were not run."""
        for number, (status, found) in zip(numbers, outcomes):
            self.status[number] = status
            for place, (name, value) in enumerate((found or {}).items()):
                if (number, place) < self._first_positions.get(name, (len(self.status), 0)):
                    self._first_positions[name] = number, place
                array = self._arrays.get(name)
                if array is None or not _fits(array, value):
                    array = self._arrays[name] = self._enlarged(array, value)
                if array.ndim == 1:
                    array[number] = value
                else:
                    array[number, : np.size(value)] = value
        self.done += len(outcomes)

    def values(
        self, shape: tuple[int, ...], nothing: Mapping[str, float | str] | None = None
    ) -> dict[str, np.ndarray]:
        """Return the arrays by name; `nothing` contains the values for points without a result."""
        for name, value in (nothing or {}).items():
            if name not in self._arrays:
                self._arrays[name] = np.full(len(self.status), value, dtype=_kind(value))
        names = sorted(self._arrays, key=lambda name: self._first_positions.get(name, (len(self.status), 0)))
        return {name: self._arrays[name].reshape(*shape, *self._arrays[name].shape[1:]) for name in names}

    def _enlarged(self, old: np.ndarray | None, value: Reading) -> np.ndarray:
        """Return an array that is large enough for new values, with the content of the old array."""
        total, kind = len(self.status), _kind(value)
        long = np.ndim(value) == 1
        length = np.size(value) if long else None
        if old is not None:
            kind = max(kind, old.dtype, key=_KINDS.index)
            if old.ndim == 2 or long:
                length = max(length or 1, old.shape[1] if old.ndim == 2 else 1)
        shape = (total,) if length is None else (total, length)
        new = np.full(shape, "" if kind.hasobject else np.nan, dtype=kind)
        if old is not None and new.ndim == 1:
            new[:] = old
        elif old is not None:
            new[:, : old.shape[1] if old.ndim == 2 else 1] = old.reshape(total, -1)
        return new


_KINDS = [np.dtype(float), np.dtype(complex), np.dtype(object)]


def _kind(value: Reading) -> np.dtype:
    if isinstance(value, str):
        return _KINDS[2]
    return _KINDS[1] if np.iscomplexobj(value) else _KINDS[0]


def _fits(array: np.ndarray, value: Reading) -> bool:
    if isinstance(value, float):
        return True
    if _KINDS.index(_kind(value)) > _KINDS.index(array.dtype):
        return False
    return np.ndim(value) == 0 or (array.ndim == 2 and np.size(value) <= array.shape[1])
