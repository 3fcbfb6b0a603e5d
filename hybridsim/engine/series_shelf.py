"""The series of a structure's modes as machine code, of one order: for those modes that take many steps.

A mode begins with the interpreter of `hybridsim.engine.taylor`; where it has taken enough steps its code is compiled,
or read from disk where an earlier process has left it. Both give the same bits, so it does not matter when.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from threading import Lock
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.bernstein_code import LEADING, bernstein_code
from hybridsim.engine.jit import ENABLED, compile_series, is_kept
from hybridsim.engine.mode_code import KNOWN, NEVER, WORTH, kept, mode_tape
from hybridsim.engine.mode_tables import Tapes
from hybridsim.engine.packs import packed
from hybridsim.engine.series_code import TooLong, series_text
from hybridsim.engine.system import System


class Codes(NamedTuple):
    """Addresses of code for each vector of modes on a shelf, 0 where there is none.

    series, values, ahead, sizes: see `hybridsim.engine.series_code`; lacked: the steps that were taken without.
    bernstein: of the functions of `hybridsim.engine.bernstein_code`.
    """

    series: np.ndarray
    values: np.ndarray
    ahead: np.ndarray
    sizes: np.ndarray
    lacked: np.ndarray
    bernstein: np.ndarray


class SeriesShelf:
    """Machine code of one structure at one order, in the order of its tapes."""

    def __init__(self, system: System, order: int) -> None:
        self.system, self.order = system, order
        self._lock = Lock()
        self._engines: list[Any] = []  # what keeps the code alive
        self._known: tuple[Tapes | None, Codes, Any] = (None, _codes(0), None)

    def of(self, tapes: Tapes) -> Any:
        """The code for these tapes, packed as kernels take it."""
        known = self._known  # read once: other threads may put theirs in its place at any time
        if known[0] is not tapes:
            with self._lock:
                former, codes = self._known[1], _codes(len(tapes.modes))
                for old, new in zip(former, codes, strict=True):
                    new[: len(old)] = old  # a shelf only grows
                self._known = known = tapes, codes, packed(codes)
        return known[2]

    def look(self, tapes: Tapes, codes: Codes) -> None:
        """Get code ready for the modes that have taken many steps without it."""
        if not ENABLED or codes.lacked.max(initial=0) < KNOWN:
            return
        for k in np.flatnonzero(codes.lacked >= KNOWN).tolist():
            place = kept(self.system, f"series{self.order}", tapes.modes[k])
            if codes.lacked[k] >= WORTH or is_kept(place):
                with self._lock:
                    self._make(tapes.modes[k], place, codes, k)

    def _make(self, z: np.ndarray, place: Path, codes: Codes, k: int) -> None:
        if codes.lacked[k] < KNOWN:  # another thread was first
            return
        tape = mode_tape(self.system, z)
        codes.lacked[k] = NEVER
        if tape.is_known:
            with suppress(TooLong):  # it stays with the interpreter
                (series, values, ahead, sizes), engine = compile_series(
                    place,
                    ("series_0", "values_0", "ahead_0", "sizes_0"),
                    lambda: series_text(tape, self.order),
                )
                forms, other = bernstein_code(self.order)
                self._engines += [engine, other]
                codes.bernstein[:] = forms
                codes.values[k], codes.ahead[k], codes.sizes[k] = values, ahead, sizes
                codes.series[k] = series  # the last: kernels look at it first


def _codes(count: int) -> Codes:
    return Codes(*(np.zeros(size, dtype=np.int64) for size in (*[count] * 5, LEADING)))
