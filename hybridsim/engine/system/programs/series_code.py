"""Machine code of Taylor's method: series of one order, for the modes of a structure."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybridsim.engine.series.emit_bernstein import LEADING, bernstein_code
from hybridsim.engine.series.emit_series import ModeTape, series_text
from hybridsim.engine.system.programs.code_cache import CodeCache
from hybridsim.engine.system.system import System


class Codes(NamedTuple):
    """A `CodeCache` tuple: series, values, ahead and sizes are those of `hybridsim.engine.series.emit_series`.

    bernstein: addresses of the functions of `hybridsim.engine.series.emit_bernstein`.
    """

    series: np.ndarray
    values: np.ndarray
    ahead: np.ndarray
    sizes: np.ndarray
    lacked: np.ndarray
    bernstein: np.ndarray


class SeriesCodeCache(CodeCache):
    """Machine code of one structure at one order."""

    codes = Codes
    functions = ("series", "values", "ahead", "sizes")

    def __init__(self, system: System, order: int) -> None:
        super().__init__(system, f"series{order}")
        self.order = order

    def _text(self, tape: ModeTape) -> str:
        return series_text(tape, self.order)

    def _blank(self, count: int) -> Codes:
        return super()._blank(count)._replace(bernstein=np.zeros(LEADING, dtype=np.int64))

    def _put(self, codes: Codes, k: int, addresses: list[int]) -> None:
        codes.bernstein[:], engine = bernstein_code(self.order)
        self._engines.append(engine)
        super()._put(codes, k, addresses)
