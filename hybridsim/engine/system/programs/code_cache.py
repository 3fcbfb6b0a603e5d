"""This module compiles machine code for modes in which a run takes many steps.

A mode starts with the interpreter of `hybridsim.engine.series.interpreter`. After enough steps its code is compiled, or
read from disk if an earlier process stored it. Both give the same bits, so the time of the switch does not matter.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.series.emit_bernstein import LEADING, bernstein_code
from hybridsim.engine.series.emit_series import ModeTape, ends_text, series_text
from hybridsim.engine.system.per_structure import per_structure
from hybridsim.engine.system.programs.mode_code import ModeCompiler
from hybridsim.engine.system.programs.mode_tables import Tapes
from hybridsim.engine.system.system import System
from hybridsim.forks import SharedLock


class Codes(NamedTuple):
    """Addresses of the machine code of Taylor's method, by combination of modes.

    0 means that there is none. lacked: number of steps without code. bernstein: addresses of the functions of
    `hybridsim.engine.series.emit_bernstein`.
    """

    series: np.ndarray
    values: np.ndarray
    ahead: np.ndarray
    sizes: np.ndarray
    lacked: np.ndarray
    bernstein: np.ndarray


class EndsCodes(NamedTuple):
    """Addresses of the machine code of Runge-Kutta methods, by combination of modes."""

    ends: np.ndarray
    first: np.ndarray
    along: np.ndarray
    values: np.ndarray
    lacked: np.ndarray


class CodeCache:
    """Machine code of all systems with the same structure, in the order of the instruction tapes.

    Parameters
    ----------
    kind : name of the files in which the code is stored.
    codes : a named tuple of integer arrays: for each function its addresses, one for each vector of modes, 0 for none,
        and then `lacked`, which counts the steps taken without code.
    text : returns the source of a module with the functions of a tape.
    """

    def __init__(self, system: System, kind: str, codes: Any, text: Callable[[ModeTape], str]) -> None:
        self.codes, self.functions = codes, codes._fields[: codes._fields.index("lacked")]
        self.compiler = ModeCompiler(
            system, kind, self.functions, lambda tape, z: partial(text, tape) if tape.is_known else None
        )
        self._lock = SharedLock()
        self._known: tuple[Tapes | None, Any, Any] = (None, self._blank(0), None)

    def _blank(self, count: int) -> Any:
        """Return an empty table of code addresses for a number of combinations of modes."""
        return self.codes(*(np.zeros(count, dtype=np.int64) for _ in self.codes._fields))

    def of(self, tapes: Tapes) -> Any:
        """Return the packed machine code for the given instruction tapes."""
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
        """Compile code for modes in which many steps were taken without compiled code."""
        self.compiler.prepare(tapes.modes, codes.lacked, partial(self._put, codes))

    def _put(self, codes: Any, k: int, addresses: list[int]) -> None:
        for name, address in zip(self.functions[::-1], addresses[::-1], strict=True):
            getattr(codes, name)[k] = address  # in reverse order, because kernels test the first one


class SeriesCodes(CodeCache):
    """Machine code for Taylor series of one order, shared by systems of the same structure."""

    def __init__(self, system: System, order: int) -> None:
        super().__init__(system, f"series{order}", Codes, partial(series_text, order=order))
        self.order = order

    def _blank(self, count: int) -> Codes:
        codes: Codes = super()._blank(count)
        return codes._replace(bernstein=np.zeros(LEADING, dtype=np.int64))

    def _put(self, codes: Codes, k: int, addresses: list[int]) -> None:
        codes.bernstein[:], _ = bernstein_code(self.order)
        super()._put(codes, k, addresses)


series_codes = per_structure(SeriesCodes)


@per_structure
def ends_codes(system: System, terms: int, first: int, order: int) -> CodeCache:
    """Return the machine code of Runge-Kutta methods for a system.

    Parameters
    ----------
    terms : number of terms of the states at the end of a step.
    first : order of the states at the start of a segment.
    order : order of the guards along a step.
    """
    text = partial(ends_text, terms=terms, first=first, order=order)
    return CodeCache(system, f"ends{terms}.{first}.{order}", EndsCodes, text)
