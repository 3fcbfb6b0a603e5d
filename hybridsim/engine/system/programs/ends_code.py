"""Machine code of Runge-Kutta methods: short series at the ends of steps, for the modes of a structure."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybridsim.engine.series.emit_series import ModeTape, ends_text
from hybridsim.engine.system.programs.code_cache import CodeCache
from hybridsim.engine.system.system import System


class EndsCodes(NamedTuple):
    """A `CodeCache` tuple with functions at the end of a step, at the start of a segment, and for guards."""

    ends: np.ndarray
    first: np.ndarray
    along: np.ndarray
    values: np.ndarray
    lacked: np.ndarray


class EndsCodeCache(CodeCache):
    """Machine code of one structure.

    Parameters
    ----------
    terms : number of terms of the states at the end of a step.
    first : order of the states at the start of a segment.
    order : order of the guards along a step.
    """

    codes = EndsCodes
    functions = ("ends", "first", "along", "values")

    def __init__(self, system: System, terms: int, first: int, order: int) -> None:
        super().__init__(system, f"ends{terms}.{first}.{order}")
        self.shape = (terms, first, order)

    def _text(self, tape: ModeTape) -> str:
        return ends_text(tape, *self.shape)
