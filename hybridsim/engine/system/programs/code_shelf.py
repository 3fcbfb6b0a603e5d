"""Machine code of a structure's modes: for those that a run goes on in for long.

A mode begins with the interpreter of `hybridsim.engine.series.interpreter`; where it has taken enough steps its code
is compiled, or read from disk where an earlier process has left it. Both give the same bits, so it does not matter
when.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import suppress
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from hybridsim.engine.native.kernels import ENABLED, compile_series, is_kept
from hybridsim.engine.native.llvm_text import TooLong
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.series.emit_series import ModeTape
from hybridsim.engine.system.programs.mode_code import KNOWN, NEVER, WORTH, kept, mode_tape
from hybridsim.engine.system.programs.mode_tables import Tapes
from hybridsim.engine.system.system import System
from hybridsim.forks import SharedLock


class CodeShelf(ABC):
    """Machine code of one structure, in the order of its tapes.

    Parameters
    ----------
    kind : names the files in which it is kept.

    A shelf's `codes` is a named tuple of integer arrays: for each of its `functions` the addresses, one for each
    vector of modes, 0 where there is none; and `lacked`, the steps that were taken without.
    """

    codes: ClassVar[Any]
    functions: ClassVar[tuple[str, ...]]

    def __init__(self, system: System, kind: str) -> None:
        self.system, self.kind = system, kind
        self._lock = SharedLock()
        self._engines: list[Any] = []  # what keeps the code alive
        self._known: tuple[Tapes | None, Any, Any] = (None, self._blank(0), None)

    @abstractmethod
    def _text(self, tape: ModeTape) -> str:
        """A module with the functions of a mode, their names followed by _0."""

    def _blank(self, count: int) -> Any:
        """Codes for so many vectors of modes: no address yet."""
        return self.codes(*(np.zeros(count, dtype=np.int64) for _ in self.codes._fields))

    def of(self, tapes: Tapes) -> Any:
        """The code for these tapes, packed as kernels take it."""
        known = self._known  # read once: other threads may put theirs in its place at any time
        if known[0] is not tapes:
            with self._lock:
                former, codes = self._known[1], self._blank(len(tapes.modes))
                for old, new in zip(former, codes, strict=True):
                    shared = min(len(old), len(new))
                    new[:shared] = old[:shared]
                known = tapes, codes, packed(codes)
                # a shelf only grows, but another thread may be ahead
                if len(codes.lacked) >= len(former.lacked):
                    self._known = known
        return known[2]

    def look(self, tapes: Tapes, codes: Any) -> None:
        """Get code ready for the modes that have taken many steps without it."""
        if not ENABLED or max(codes.lacked.tolist(), default=0) < KNOWN:
            return
        for k in np.flatnonzero(codes.lacked >= KNOWN).tolist():
            place = kept(self.system, self.kind, tapes.modes[k])
            if codes.lacked[k] >= WORTH or is_kept(place):
                with self._lock:
                    self._make(tapes.modes[k], place, codes, k)

    def _make(self, z: np.ndarray, place: Path | None, codes: Any, k: int) -> None:
        if codes.lacked[k] < KNOWN:  # another thread was first
            return
        tape = mode_tape(self.system, z)
        codes.lacked[k] = NEVER
        if tape.is_known:
            with suppress(TooLong):  # it stays with the interpreter
                names = tuple(f"{name}_0" for name in self.functions)
                addresses, engine = compile_series(place, names, lambda: self._text(tape))
                self._engines.append(engine)
                self._put(codes, k, addresses)

    def _put(self, codes: Any, k: int, addresses: list[int]) -> None:
        for name, address in zip(self.functions[::-1], addresses[::-1], strict=True):
            getattr(codes, name)[k] = address  # the first one last: kernels look at it first
