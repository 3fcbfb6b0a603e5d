"""This module writes code for short Taylor series of guards, with bounds of their rounding errors.

The kernels of `hybridsim.engine.series.bounded` write it (`hybridsim.engine.series.trace`), so that both give the same
to the last bit if values are finite. Exact values carry no bound and add nothing to other bounds.

The functions are void f(s, s_error, x, x_error, p, out): local time and state with the bounds of their
errors, the run-time vector, and the output with the coefficients of the guards (guards, ORDER + 1) followed
by their bounds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybridsim.engine.native.llvm_text import DECLARATIONS, function, number
from hybridsim.engine.series import bounded
from hybridsim.engine.series.bounded import ORDER, UNIT
from hybridsim.engine.series.emit_series import KNOWN, ModeTape
from hybridsim.engine.series.operations import LESS, LESS_EQUAL
from hybridsim.engine.series.trace import Coefficients, Size, Trace, Value, written

_ASKED = frozenset((LESS, LESS_EQUAL))  # comparisons, here only between constants


@dataclass(frozen=True)
class ConstantSources:
    """The sources of the constants of an instruction tape: numbers with errors, parameters, and phases."""

    numbers: Mapping[int, tuple[float, float]]
    sources: Mapping[int, int]
    phases: frozenset[int]


class _Bounded(Trace):
    """The Taylor coefficients of every register up to ORDER, with their error bounds."""

    def __init__(
        self, tape: ModeTape, constant_rows: Sequence[tuple[int, ...]], constant_sources: ConstantSources
    ) -> None:
        super().__init__("v", bounded, _advance=self._advance)
        self.constant_sources = constant_sources
        self.V, self.E = Coefficients(ORDER, self._constant), Coefficients(ORDER, self._error)
        for i, r in enumerate(tape.states):
            self.V[r, 0], self.E[r, 0] = self.read("%x", i), Size(self, self.load("%g", i))
        if tape.time >= 0:
            self.V[tape.time, 0], self.E[tape.time, 0] = Value(self, "%s"), Size(self, "%e")
            self.V[tape.time, 1] = 1.0
        for row in constant_rows:
            self._advance(row, self.V, self.E, 0)
        rows = np.array(tape.rows, dtype=object).reshape(-1, 5)
        states, rates = (np.array(registers, dtype=object) for registers in (tape.states, tape.rates))
        self.run.run_tape(rows, ORDER, states, rates, self.V, self.E)

    def _advance(self, row: Sequence[int], V: Coefficients, E: Coefficients, k: int) -> None:
        self.on_all_paths(self.run._advance, row, (V, E), k)

    def _constant(self, r: int, k: int) -> Any:
        """Return coefficient k of a constant as text."""
        if k > 0:
            return 0.0
        if r in self.constant_sources.sources:
            return self.read("%c", self.constant_sources.sources[r])
        return Value(self, number(self.constant_sources.numbers.get(r, (0.0, 0.0))[0]))

    def _error(self, r: int, k: int) -> Any:
        """Return the error bound of a constant as text."""
        if k > 0 or r in self.constant_sources.sources:
            is_phase = k == 0 and r in self.constant_sources.phases
            return 2.0 * UNIT * abs(self._constant(r, k)) if is_phase else 0.0
        off = self.constant_sources.numbers.get(r, (0.0, 0.0))[1]
        return Size(self, number(off)) if off else 0.0


def can_bound(tape: ModeTape, constant_rows: Sequence[tuple[int, ...]]) -> bool:
    """Return whether every instruction of a tape can be written as straight-line code."""
    return tape.is_known and all(row[0] in KNOWN | _ASKED for row in constant_rows)


def bounds_text(
    tape: ModeTape,
    constant_rows: Sequence[tuple[int, ...]],
    constant_sources: ConstantSources,
    numbers: Sequence[int],
    guards: int,
) -> str:
    """Return the text of a module with the function bounds_0 for the active guards.

    Raise TooLong if it would take too long to compile.
    """
    code, size = _Bounded(tape, constant_rows, constant_sources), ORDER + 1
    for g, r in zip(numbers, tape.guards, strict=True):
        for k in range(size):
            code.store(written(code.V[r, k]), "%out", g * size + k)
            code.store(written(code.E[r, k]), "%out", (guards + g) * size + k)
    return DECLARATIONS + function("bounds_0", code.lines)
