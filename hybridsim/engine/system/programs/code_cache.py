"""Compile machine code for the modes in which a run takes many steps.

A mode starts with the interpreter of `hybridsim.engine.series.interpreter`. After enough steps its code is compiled, or
read from disk if an earlier process stored it. Both give the same bits, so the time of the switch does not matter.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import suppress
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from hybridsim.engine.native.kernels import ENABLED, compile_series, is_stored
from hybridsim.engine.native.llvm_text import TooLong
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.series.emit_series import ModeTape
from hybridsim.engine.system.programs.mode_code import KNOWN, NEVER, WORTH, code_path, mode_tape
from hybridsim.engine.system.programs.mode_tables import Tapes
from hybridsim.engine.system.system import System
from hybridsim.forks import SharedLock


class CodeCache(ABC):
    """Machine code of one structure, in the order of its tapes.

    Parameters
    ----------
    kind : name of the files in which the code is stored.

    `codes` is a named tuple of integer arrays. For each of the `functions` it has the addresses, one for each vector of
    modes, 0 for none. `lacked` counts the steps taken without code.
    """

    codes: ClassVar[Any]
    functions: ClassVar[tuple[str, ...]]

    def __init__(self, system: System, kind: str) -> None:
        self.system, self.kind = system, kind
        self._lock = SharedLock()
        self._engines: list[Any] = []  # references that keep the code alive
        self._known: tuple[Tapes | None, Any, Any] = (None, self._blank(0), None)

    @abstractmethod
    def _text(self, tape: ModeTape) -> str:
        """Return the source of a module with the functions of a mode, whose names end with _0."""

    def _blank(self, count: int) -> Any:
        """Return codes without addresses for a given number of mode vectors."""
        return self.codes(*(np.zeros(count, dtype=np.int64) for _ in self.codes._fields))

    def of(self, tapes: Tapes) -> Any:
        """Return the code for these tapes, packed for kernels."""
        known = self._known  # read once, because other threads may replace it
        if known[0] is not tapes:
            with self._lock:
                former, codes = self._known[1], self._blank(len(tapes.modes))
                for old, new in zip(former, codes, strict=True):
                    shared = min(len(old), len(new))
                    new[:shared] = old[:shared]
                known = tapes, codes, packed(codes)
                # codes only grow, but another thread may be ahead
                if len(codes.lacked) >= len(former.lacked):
                    self._known = known
        return known[2]

    def look(self, tapes: Tapes, codes: Any) -> None:
        """Prepare code for the modes that have taken many steps without it."""
        if not ENABLED or max(codes.lacked.tolist(), default=0) < KNOWN:
            return
        for k in np.flatnonzero(codes.lacked >= KNOWN).tolist():
            place = code_path(self.system, self.kind, tapes.modes[k])
            if codes.lacked[k] >= WORTH or is_stored(place):
                with self._lock:
                    self._make(tapes.modes[k], place, codes, k)

    def _make(self, z: np.ndarray, place: Path | None, codes: Any, k: int) -> None:
        if codes.lacked[k] < KNOWN:  # another thread was first
            return
        tape = mode_tape(self.system, z)
        codes.lacked[k] = NEVER
        if tape.is_known:
            with suppress(TooLong):  # too long to compile; the interpreter stays in use
                names = tuple(f"{name}_0" for name in self.functions)
                addresses, engine = compile_series(place, names, lambda: self._text(tape))
                self._engines.append(engine)
                self._put(codes, k, addresses)

    def _put(self, codes: Any, k: int, addresses: list[int]) -> None:
        for name, address in zip(self.functions[::-1], addresses[::-1], strict=True):
            getattr(codes, name)[k] = address  # in reverse order, because kernels test the first one
