"""This module connects Runge-Kutta methods to the compiled event loop: their arrays, results and cost."""

from __future__ import annotations

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
from hybridsim.engine.roots.dense_guards import guard_search
from hybridsim.engine.run.method_kernels import StepKernels
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
    stages: np.ndarray
    first: np.ndarray
    left: np.ndarray
    right: np.ndarray
    polynomial: np.ndarray
    polynomials: np.ndarray
    guards_left: np.ndarray
    guards: np.ndarray  # at the end of the step
    lack: np.ndarray
    dx: np.ndarray
    memory: np.ndarray
    counts: np.ndarray  # as in `hybridsim.integrators.polynomial_steps.PolynomialArrays`
    search: Any  # `hybridsim.engine.roots.dense_guards.GuardSearch`


class RungeKuttaKernels(StepKernels):
    """Connects an explicit Runge-Kutta method to the compiled loop of a run."""

    loop = staticmethod(runge_kutta_loop)
    blocks = HermiteBlock
    is_looked_at: ClassVar[bool] = True  # whether stiffness is monitored
    remembers: ClassVar[bool] = True

    def __init__(self, system: System, tolerances: Tolerances, longest: float, tableau: Tableau) -> None:
        super().__init__(system, longest, 2 * TERMS)
        self.tableau, (q, c, c_next, q_low, c_low) = tableau, tableau.leading_terms
        first = q + 1  # order of the states at the start of a segment
        self.order = max(short_order(tolerances.rtol), 2 * TERMS + 1, first)
        self.kind = f"{len(tableau.c)} stages, order {self.order}"
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
        system, n, guards = self.system, self.system.n, self.system.guard_count
        return packed(
            RungeKuttaArrays(
                settings=self.settings,
                **self.of_tapes(tape_cache_of(system).tapes),
                first_step=np.empty(2),
                stages=np.empty((len(self.tableau.c), n)),
                first=np.empty((n, self.tableau.leading_terms[0] + 2)),
                **{name: np.empty((n, TERMS)) for name in ("left", "right")},
                polynomial=np.empty((n, 2 * TERMS)),
                polynomials=np.empty((guards, 2 * TERMS)),
                **{name: np.empty((guards, TERMS)) for name in ("guards_left", "guards")},
                lack=np.empty(TERMS),
                dx=np.empty(n),
                memory=np.empty(3),
                counts=np.zeros(6, dtype=np.int64),
                search=guard_search(system, self.order),
            )
        )

    def begin(self, own: Any, tapes: Tapes) -> Any:
        """Write the settings and the compiled operations of the run to the arrays."""
        own.first_step[0], own.counts[:] = self.first_step, 0
        return replaced(self.with_tapes(own, tapes), settings=self.settings)

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
