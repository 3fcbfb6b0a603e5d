"""This module connects Runge-Kutta methods to the compiled event loop: their arrays, results and cost."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np

from hybridsim.engine.native.struct_pack import packed, replaced
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.hermite import (
    Hermite,
    bernstein_weights,
    middle_weights,
    right_system,
    shift_matrix,
)
from hybridsim.engine.record.hermite_block import TERMS, HermiteBlock
from hybridsim.engine.run.method_kernels import MethodKernels, StepRows
from hybridsim.engine.system.programs.code_cache import ends_codes
from hybridsim.engine.system.programs.guard_parts import guard_parts_of
from hybridsim.engine.system.programs.mode_tables import Tapes, tape_cache_of
from hybridsim.engine.system.series_at import short_order
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.integrators.runge_kutta.segments import runge_kutta_loop
from hybridsim.integrators.runge_kutta.step import Tableau

_HERMITE = packed(
    Hermite(shift_matrix(TERMS), right_system(TERMS), bernstein_weights(TERMS), middle_weights(TERMS))
)


class RungeKuttaSettings(NamedTuple):
    """The coefficients of a Runge-Kutta method, and the settings of a run."""

    tableau: Any  # `hybridsim.integrators.runge_kutta.step.Coefficients`
    hermite: Any  # `hybridsim.engine.record.hermite.Hermite`
    leading_orders: np.ndarray  # orders of the main and the low estimate, see `first_length`
    leading: np.ndarray  # their coefficients
    orders: np.ndarray  # order of the error estimate, and of the series of guards
    control: np.ndarray  # rtol, longest step
    atol: np.ndarray  # (n,)


class RungeKuttaArrays(NamedTuple):
    """The arrays of the segment kernel: settings, Taylor series, and work vectors."""

    settings: Any  # `RungeKuttaSettings`
    parts: Any  # `hybridsim.engine.system.programs.guard_parts.Parts` of the tapes
    codes: Any  # `hybridsim.engine.system.programs.ends_code.EndsCodes` of the tapes
    # length of the first step (0: unknown), which is cleared after use, and its value at the start of the segment
    first_step: np.ndarray
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
    dx: np.ndarray
    ahead: np.ndarray
    rates: np.ndarray
    guard_registers: np.ndarray
    numbers: np.ndarray
    sides: np.ndarray
    orders: np.ndarray
    floors: np.ndarray
    memory: np.ndarray
    counts: np.ndarray  # tried and rejected steps, and both at the start of the segment


class RungeKuttaKernels(MethodKernels):
    """Connects an explicit Runge-Kutta method to the compiled loop of a run."""

    loop = staticmethod(runge_kutta_loop)
    rows = StepRows
    is_looked_at: ClassVar[bool] = True  # whether stiffness is monitored
    remembers: ClassVar[bool] = True

    def __init__(self, system: System, tolerances: Tolerances, longest: float, tableau: Tableau) -> None:
        super().__init__(system, longest)
        self.tableau, (q, c, c_next, q_low, c_low) = tableau, tableau.leading_terms
        first = q + 1  # order of the states at the start of a segment
        self.order = max(short_order(tolerances.rtol), 2 * TERMS + 1, first)
        self.kind = f"{len(tableau.c)} stages, order {self.order}"
        self.columns = system.n * 2 * TERMS + 2
        self.parts = guard_parts_of(system)
        self.codes = ends_codes(system, TERMS, first, self.order)
        self.settings = packed(
            RungeKuttaSettings(
                tableau.packed,
                _HERMITE,
                np.array([q, q_low], dtype=np.int64),
                np.array([c, c_next, c_low]),
                np.array([tableau.error_order, self.order], dtype=np.int64),
                np.array([tolerances.rtol, tolerances.max_step]),
                np.array(tolerances.atol, dtype=float),
            )
        )
        self.first_step = tolerances.first_step or 0.0

    def arrays(self) -> Any:
        """Return new arrays for one call of the compiled Runge-Kutta loop."""
        system, n, columns, tapes = (
            self.system,
            self.system.n,
            self.order + 1,
            tape_cache_of(self.system).tapes,
        )
        guards, registers, whole = system.guard_count, system.registers.count, np.int64
        return packed(
            RungeKuttaArrays(
                settings=self.settings,
                parts=self.parts.of(tapes),
                codes=self.codes.of(tapes),
                first_step=np.empty(2),
                V=np.zeros((registers, columns)),
                W=np.zeros((registers, columns)),
                a=np.empty(columns),
                b=np.empty(columns),
                stack=np.empty((64, columns + 2)),
                powers=np.empty(columns + 1),
                **{name: np.empty(guards) for name in ("values", "sums", "totals", "floors")},
                bernstein=np.zeros(0, dtype=whole),
                stages=np.empty((len(self.tableau.c), n)),
                states=np.empty((n, columns)),
                guard_series=np.empty((guards, columns)),
                everyone=np.arange(guards, dtype=whole),
                first=np.empty((n, self.tableau.leading_terms[0] + 2)),
                left=np.empty((n, TERMS)),
                right=np.empty((n, TERMS)),
                polynomial=np.empty((n, 2 * TERMS)),
                polynomials=np.empty((guards, 2 * TERMS)),
                guards_left=np.empty((guards, TERMS)),
                guards_right=np.empty((guards, TERMS)),
                lack=np.empty(TERMS),
                **{name: np.empty(n) for name in ("dx", "ahead", "rates")},
                **{
                    name: np.empty(guards, dtype=whole)
                    for name in ("guard_registers", "numbers", "sides", "orders")
                },
                memory=np.empty(3),
                counts=np.zeros(4, dtype=whole),
            )
        )

    def fields(self) -> Sequence[tuple[Any, tuple[int, ...]]]:
        """Return the dtype and the row shape of each array in `rows`."""
        return (float, (2,)), (float, (self.system.n, 2 * TERMS))

    def begin(self, own: Any, tapes: Tapes) -> Any:
        """Write the settings and the compiled operations of the run to the arrays."""
        own.first_step[0], own.counts[:] = self.first_step, 0
        return replaced(self.with_tapes(own, tapes), settings=self.settings)

    def with_tapes(self, own: Any, tapes: Tapes) -> Any:
        """Return the arrays with the guard instructions and the machine code of the instruction tapes."""
        return replaced(own, parts=self.parts.of(tapes), codes=self.codes.of(tapes))

    def end(self, own: Any, tapes: Tapes, lin: Any) -> Any:
        """Return the numbers of tried and rejected steps, and the length of the next step."""
        self.codes.look(tapes, own.codes)
        return (*own.counts[:2].tolist(), float(own.first_step[0]))

    def count(self, counters: Counters, steps: int, result: Any) -> None:
        """Add the cost of the steps to the counters of the run."""
        tries, rejected, _ = result
        counters.rejected += rejected
        # the series include the slope; one more in the middle
        counters.rhs_evaluations += tries * (len(self.tableau.c) - 1) + 2 * steps

    def take(self, result: Any) -> None:
        """Store the length of the next step if a call ended within a segment."""
        self.first_step = result[2]

    def block(self, result: Any, rows: StepRows, last_steps: np.ndarray, *record: np.ndarray) -> HermiteBlock:
        """Return the segments that one call of the compiled loop has stored."""
        return HermiteBlock(self.recorded, last_steps, *rows, *record)
