"""This module connects Taylor's method to the compiled event loop: its arrays, results and cost."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.constants import TIGHTEST
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.roots.defect_check import ahead_size
from hybridsim.engine.run.method_kernels import StepKernels
from hybridsim.engine.system.programs.code_cache import series_codes
from hybridsim.engine.system.programs.high_parts import high_parts_of
from hybridsim.engine.system.programs.mode_code import most_fading
from hybridsim.engine.system.programs.mode_tables import Tapes, tape_cache_of
from hybridsim.engine.system.series_at import series_order
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.integrators.taylor.segments import taylor_loop


class TaylorSettings(NamedTuple):
    """The settings of one run by Taylor's method."""

    control: np.ndarray  # rtol, longest step
    atol: np.ndarray  # (n,)


class TaylorArrays(NamedTuple):
    """The arrays of the segment kernel, for R registers, order + 1 terms and G guards."""

    high: Any  # `hybridsim.engine.system.programs.high_parts.HighParts` of the tapes
    codes: Any  # `hybridsim.engine.system.programs.series_code.Codes` of the tapes
    settings: Any  # `TaylorSettings`
    V: np.ndarray  # Taylor coefficients (R, order + 1) of all registers
    W: np.ndarray  # the same for values at other points, if the interpreter computes them
    guard_series: np.ndarray  # coefficients of active guards and of vanishing functions
    ahead: np.ndarray  # guards ahead of the step
    sizes: np.ndarray  # powers of a step, then sizes of guards over it
    numbers: np.ndarray  # 0, 1, ... for the guards
    a: np.ndarray  # coefficients (order + 1,) of a polynomial
    b: np.ndarray  # the same
    stack: np.ndarray  # its Bernstein forms
    sides: np.ndarray  # sides (G,) of the guards
    orders: np.ndarray  # their leading orders (G,)
    floors: np.ndarray  # their error bounds (G,)
    guard_registers: np.ndarray  # registers of the guards
    everyone: np.ndarray  # 0, 1, ..., n - 1
    largest: np.ndarray  # largest values (G,) of the guards on the segment


class TaylorKernels(StepKernels):
    """Connects Taylor's method to the compiled loop of a run."""

    loop = staticmethod(taylor_loop)
    adapted = ("high", "codes")

    def __init__(self, system: System, tolerances: Tolerances, longest: float) -> None:
        rtol = max(tolerances.rtol, TIGHTEST)
        self.order = series_order(rtol, system.is_linear)
        super().__init__(system, longest, self.order + 1)
        self.settings = TaylorSettings(
            np.array([rtol, tolerances.max_step]), np.array(tolerances.atol, dtype=float)
        )
        self.kind = f"order {self.order}"
        self.codes, self.high = series_codes(system, self.order), high_parts_of(system)

    def arrays(self) -> Any:
        """Return new arrays for one call of the compiled Taylor loop."""
        system, order, n = self.system, self.order, self.system.n
        registers, guards, fading = system.registers.count, system.guard_count, most_fading(system)
        return packed(
            TaylorArrays(
                **self.of_tapes(tape_cache_of(system).tapes),
                settings=packed(TaylorSettings(np.empty(2), np.empty(n))),
                V=np.zeros((registers, order + 1)),
                W=np.zeros((registers, order + 1)),
                guard_series=np.zeros((guards + fading, order + 1)),
                ahead=np.empty(ahead_size(order, n, guards)),
                sizes=np.empty(order + 1 + guards + fading),
                numbers=np.arange(guards, dtype=np.int64),
                everyone=np.arange(n, dtype=np.int64),
                a=np.empty(order + 1),
                b=np.empty(order + 1),
                stack=np.empty((64, order + 3)),
                **{name: np.empty(guards) for name in ("floors", "largest")},
                **{name: np.empty(guards, dtype=np.int64) for name in ("sides", "orders", "guard_registers")},
            )
        )

    def begin(self, own: Any, tapes: Tapes) -> Any:
        """Write the settings and the compiled operations of the run to the arrays."""
        own.settings.control[:], own.settings.atol[:] = self.settings
        return self.with_tapes(own, tapes)

    def end(self, own: Any, tapes: Tapes, lin: Any) -> None:
        """Compile machine code for modes in which many steps were taken."""
        self.codes.look(tapes, own.codes)

    def count(self, counters: Counters, steps: int, result: Any) -> None:
        """Add the cost of the steps to the counters of the run."""
        counters.rhs_evaluations += 2 * steps  # one series and one check per step
