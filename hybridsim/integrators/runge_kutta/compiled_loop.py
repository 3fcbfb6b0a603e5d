"""The compiled mode loop of a Runge-Kutta method, for the general mode loop."""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple, cast

import numpy as np

from hybridsim.engine.native.kernels import Precompiled
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.hermite import (
    Hermite,
    bernstein_weights,
    middle_weights,
    right_system,
    shift_matrix,
)
from hybridsim.engine.record.hermite_block import TERMS, HermiteBlock
from hybridsim.engine.run.compiled_loop import NOT_LINEAR, CompiledLoopBase
from hybridsim.engine.system.programs.code_cache import ends_codes
from hybridsim.engine.system.programs.guard_parts import guard_parts_of
from hybridsim.engine.system.series_at import short_order
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.integrators.runge_kutta.segments import rk_event_loop
from hybridsim.integrators.runge_kutta.step import Tableau

_HERMITE = packed(
    Hermite(shift_matrix(TERMS), right_system(TERMS), bernstein_weights(TERMS), middle_weights(TERMS))
)


class Scratch(NamedTuple):
    """Scratch arrays of the kernel: series of all registers, of guards, of the states at both ends, vectors."""

    V: np.ndarray
    W: np.ndarray
    a: np.ndarray
    b: np.ndarray
    stack: np.ndarray
    powers: np.ndarray
    values: np.ndarray
    sums: np.ndarray
    totals: np.ndarray
    bernstein: np.ndarray
    stages: np.ndarray
    states: np.ndarray
    guard_series: np.ndarray
    everyone: np.ndarray
    first: np.ndarray
    left: np.ndarray
    right: np.ndarray
    polynomial: np.ndarray
    polynomials: np.ndarray
    guards_left: np.ndarray
    guards_right: np.ndarray
    lack: np.ndarray
    scale: np.ndarray
    dx: np.ndarray
    ahead: np.ndarray
    rates: np.ndarray
    guard_registers: np.ndarray
    numbers: np.ndarray
    sides: np.ndarray
    orders: np.ndarray
    floors: np.ndarray
    pace: np.ndarray
    memory: np.ndarray
    counts: np.ndarray


_event_loop = Precompiled(rk_event_loop)


class RungeKuttaLoop(CompiledLoopBase):
    """The compiled loop of an explicit Runge-Kutta method."""

    is_looked_at: ClassVar[bool] = True  # whether stiffness is monitored

    def __init__(self, system: System, tolerances: Tolerances, longest: float, tableau: Tableau) -> None:
        rtol = tolerances.rtol
        self.tableau, leading = tableau, tableau.leading_terms
        first = leading[0] + 1  # order of the states at the start of a segment
        self.order = max(short_order(rtol), 2 * TERMS + 1, first)
        super().__init__(system, 2 * TERMS, f"{len(tableau.c)} stages, order {self.order}")
        self.parts = guard_parts_of(system)
        self.codes = ends_codes(system, TERMS, first, self.order)
        self.method = (tableau.packed, leading, tableau.error_order, _HERMITE)
        declared_step = np.array([tolerances.first_step or 0.0])
        self.control: tuple[Any, ...] = (
            rtol,
            tolerances.atol,
            self.order,
            tolerances.max_step,
            longest,
            declared_step,
        )

    def fresh_copy(self) -> RungeKuttaLoop:
        """Return a fresh loop for another run, which determines its own first step."""
        other = cast("RungeKuttaLoop", super().fresh_copy())
        *rest, declared_step = self.control
        other.control = (*rest, declared_step.copy())
        return other

    def _scratch(self) -> Scratch:
        system, n, columns = self.system, self.system.n, self.order + 1
        guards, registers = system.guard_count, system.registers.count
        scratch: Scratch = packed(
            Scratch(
                V=np.zeros((registers, columns)),
                W=np.zeros((registers, columns)),
                a=np.empty(columns),
                b=np.empty(columns),
                stack=np.empty((64, columns + 2)),
                powers=np.empty(columns + 1),
                **{name: np.empty(guards) for name in ("values", "sums", "totals")},
                bernstein=np.zeros(0, dtype=np.int64),
                stages=np.empty((len(self.tableau.c), n)),
                states=np.empty((n, columns)),
                guard_series=np.empty((guards, columns)),
                everyone=np.arange(guards, dtype=np.int64),
                first=np.empty((n, self.tableau.leading_terms[0] + 2)),
                left=np.empty((n, TERMS)),
                right=np.empty((n, TERMS)),
                polynomial=np.empty((n, 2 * TERMS)),
                polynomials=np.empty((guards, 2 * TERMS)),
                guards_left=np.empty((guards, TERMS)),
                guards_right=np.empty((guards, TERMS)),
                lack=np.empty(TERMS),
                **{name: np.empty(n) for name in ("scale", "dx", "ahead", "rates")},
                **{
                    name: np.empty(guards, dtype=np.int64)
                    for name in ("guard_registers", "numbers", "sides", "orders")
                },
                floors=np.empty(guards),
                pace=np.empty(3),
                memory=np.empty(3),
                counts=np.zeros(2, dtype=np.int64),
            )
        )
        return scratch

    def _go(
        self,
        to: np.ndarray,
        clock: np.ndarray,
        state: Any,
        work: Any,
        scratch: Any,
        rows: Any,
    ) -> tuple[int, int, int]:
        scratch.counts[:] = 0
        tapes = self.tape_cache.tapes  # the same tapes for both, since another thread may extend the cache
        codes = self.codes.of(tapes)
        code, steps, count = _event_loop(
            self.functions, self.automata, tapes, self.parts.of(tapes), self.inputs, NOT_LINEAR, codes,
            self.phase_layout, self.method, self.control, to, clock, state, work, scratch, rows,
        )  # fmt: skip
        self.taken = tapes, codes
        return code, steps, count

    def _cost(self, scratch: Any) -> tuple[int, int]:
        tries, rejected = scratch.counts.tolist()
        return tries, rejected

    def _count(self, counters: Counters, steps: int, cost: tuple[int, int]) -> None:
        tries, rejected = cost
        counters.rejected += rejected
        # the series include the slope; one more in the middle
        counters.rhs_evaluations += tries * (len(self.tableau.c) - 1) + 2 * steps

    def _block(self, *arrays: np.ndarray) -> HermiteBlock:
        return HermiteBlock(self.system, *arrays)
