"""This module runs a mechanical system: it prepares the arrays, calls the kernels, and collects segments and events."""

from __future__ import annotations

import math
from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from hybridsim.engine.native.compiler import seconds_compiling
from hybridsim.engine.native.constants import TIGHTEST
from hybridsim.engine.native.kernels import ENABLED, call_kernel, kernel, kernel_address
from hybridsim.engine.native.simd.vectors import WIDTH, padded_rows
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.limits import UNLIMITED, LimitMonitor, LimitReached, Limits
from hybridsim.engine.series.emit_bernstein import LEADING, bernstein_code
from hybridsim.engine.system.instant import phase_of
from hybridsim.engine.system.series_at import series_order
from hybridsim.errors import UsageError
from hybridsim.mechanics import codes
from hybridsim.mechanics.arrays import Record, Scratch, State
from hybridsim.mechanics.polynomials import TERMS
from hybridsim.mechanics.series_loop.decision import choose_jointly
from hybridsim.mechanics.series_loop.expansion import expand
from hybridsim.mechanics.series_loop.loop import FRESH, LAST, RADIUS, WHERE, run
from hybridsim.mechanics.series_loop.mechanical_arrays import Built
from hybridsim.mechanics.series_loop.steps import step_length_kernel

STATUS = {
    codes.DONE: "finished", codes.INCONSISTENT: "inconsistent", codes.NONUNIQUE: "nonunique",
    codes.CASCADE: "cascade", codes.LOST: "step-failure", codes.LIMITED: "limit",
}  # fmt: skip
_SERIES_DOUBLES = 1 << 20  # doubles for the series of one call
_EVENTS = 4096  # events per call, in addition to those of one node
_WORK = 1 << 20  # coordinates times (steps + events) per call: about 0.1 s between checks of the limits
_RADIUS = 2  # radius of the first patch; it adapts
_RANGE = 280  # decades of a double, less a margin for the factors of the powers
_MIN_ORDER = 10  # a lower order makes series useless


def _order_in_range(built: Built, span: tuple[float, float]) -> int:
    """Return the largest order for which powers of rates and times do not overflow."""
    arrays = built.arrays
    rates = [abs(arrays.k_val).max(initial=0.0) ** 0.5, abs(arrays.c_val).max(initial=0.0), *arrays.rates]
    sizes = [size for size in (max(rates), abs(span[1] - span[0])) if size > 0.0]
    decades = max((abs(math.log10(size)) for size in sizes), default=0.0)
    order = int(_RANGE / max(decades, 1.0))
    if order < _MIN_ORDER:
        raise UsageError(
            f"the series coefficients overflow for rates up to {max(rates):.3g} and a time span of "
            f"{span[1] - span[0]:.3g}",
            remedy="choose a unit of time in which the rates are closer to 1",
        )
    return order


class MechanicalRun:
    """One run of a mechanical system; `go` runs it as a whole, and `begin` and `advance` run it in parts."""

    def __init__(self, built: Built, span: tuple[float, float], x: np.ndarray, rtol: float, atol: np.ndarray,
                 max_step: float, is_recorded: bool, limits: Limits = UNLIMITED) -> None:  # fmt: skip
        self.built, self.span = built, span
        self.rtol, self.is_recorded = max(rtol, TIGHTEST), is_recorded
        # the linear part of a series is the more expensive one for coupled coordinates
        self.order = min(series_order(self.rtol, linear=True), _order_in_range(built, span))
        self.max_step, self.limits = max_step, limits
        self.state = new_state(built, self.order)
        self.scratch = new_scratch(built, self.order)
        self._packs = tuple(packed(part) for part in (built.arrays, built.laws, self.state, self.scratch))
        self.state.x[:] = x.reshape(2, -1)[:, built.dofs]
        self.state.tolerance[:] = np.maximum(atol.reshape(2, -1)[:, built.dofs], 1e-300)
        self.state.clock[0] = span[0]
        self.segments: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self.events: list[np.ndarray] = []
        self.when: list[np.ndarray] = []
        self.first_modes = np.zeros(0, dtype=np.int64)
        self.code, self.kernel_time, self.limit_message = codes.DONE, 0.0, ""
        self.counters, self.compile_time = Counters(), 0.0

    def go(self, progress: Callable[[float], None] | None) -> None:
        """Run to the end of the span, or until no mode is admissible."""
        began, compiled = perf_counter(), seconds_compiling()
        self.begin()
        self.advance(progress)
        self.compile_time = seconds_compiling() - compiled
        self.kernel_time = perf_counter() - began - self.compile_time

    def begin(self) -> None:
        """Compile the kernels if necessary, and find the modes at the start."""
        self._limit_monitor = LimitMonitor(self.limits, self.counters)
        reach_kernels(self.state, *self._packs)
        if ENABLED:
            self.state.kernels[codes.BERNSTEIN :], self._code = bernstein_code(self.order - 1)
        self.code = self._resolve_start(*self._packs)
        self.first_modes = self.state.mode.copy()
        self.state.flags[FRESH], self.state.flags[RADIUS] = 1, _RADIUS

    def advance(self, progress: Callable[[float], None] | None = None) -> None:
        """Continue from the present time to the end of the span, or until no mode is admissible."""
        target = np.array([self.span[1], 0.0])
        while self.code in (codes.DONE, codes.FULL):
            record = self._record()
            until = int(self.state.counts[:2].sum()) + max(_WORK // len(self.built.dofs), 16)
            control = (self.rtol, self.max_step, self.order, self.is_recorded, until)
            self.code = run(*self._packs, packed(record), control, target)
            self._collect(record)
            if self.code != codes.FULL:
                break
            if progress is not None:
                progress((self.time - self.span[0]) / (self.span[1] - self.span[0]))
            self._count()
            try:
                self._limit_monitor.check()
            except LimitReached as reached:
                self.code, self.limit_message = codes.LIMITED, str(reached)

    def restart(self, span: tuple[float, float]) -> None:
        """Begin a new record over another span with the present states and modes, after a run to its end."""
        self.span, self.first_modes = span, self.state.mode.copy()
        self.state.clock[:] = span[0], 0.0, 0.0, math.nan
        self.segments, self.events, self.when = [], [], []

    def _count(self) -> None:
        """Update the counts of steps and events after a call of the kernel."""
        self.counters.steps, self.counters.events = self.state.counts[:2].tolist()

    def _resolve_start(self, *packs: Any) -> int:
        """Find the modes at the start: by sign for moving contacts, by joint choice for resting contacts."""
        arrays, state = self.built.arrays, self.state
        state.series[:2, : len(arrays.dof_node)] = state.x
        for r, rate in enumerate(arrays.rates):
            state.phase[r] = phase_of(state.clock[0], 0.0, rate, 0.0)
        weights = csr_array(
            (arrays.w_val, arrays.w_col, arrays.w_ptr), shape=(len(arrays.con_node), len(arrays.dof_node))
        )
        turns = state.phase[arrays.base_rate] if len(arrays.rates) else 0.0
        base = arrays.base[:, 0] + arrays.base[:, 1] * np.sin(turns) + arrays.base[:, 2] * np.cos(turns)
        state.mode[:] = np.sign(weights @ state.x[1] - base)
        if code := _resolve_nodes(*packs):
            return code
        state.x[:] = state.series[:2, : len(arrays.dof_node)]
        return codes.DONE

    @property
    def time(self) -> float:
        """The time that the run has reached."""
        clock = self.state.clock
        return float(clock[0] + clock[1] + (0.0 if self.state.flags[FRESH] else clock[3]))

    @property
    def node_contacts(self) -> list[int]:
        """The contacts (declared numbers) of the node at which the run stopped."""
        j, arrays = int(self.state.flags[WHERE]), self.built.arrays
        return [int(self.built.contacts[c]) for c in range(arrays.node_con[j], arrays.node_con[j + 1])]

    def start_segments(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return one segment of zero length per node, for a run that ends where it begins."""
        node_dof = self.built.arrays.node_dof
        nodes = len(node_dof) - 1
        start = np.zeros((nodes, 3))
        start[:, 0] = self.span[0]
        series = np.zeros((len(self.state.x[0]), self.order + 1))
        series[:, :2] = self.state.x.T
        return np.stack([np.arange(nodes), node_dof[:-1]], axis=1).astype(np.int64), start, series

    def _record(self) -> Record:
        arrays, columns = self.built.arrays, self.order + 1
        nodes, n, m = len(arrays.node_dof) - 1, len(arrays.dof_node), len(arrays.con_node)
        rows = max(_SERIES_DOUBLES // columns, 2 * n) if self.is_recorded else 0
        segments = max(rows * nodes // n, 2 * nodes) if self.is_recorded else 0
        return Record(
            np.empty((segments, 2), dtype=np.int64),
            np.empty((segments, 3)),
            np.empty((rows, columns)),
            np.empty((_EVENTS + 2 * m, 4), dtype=np.int64),
            np.empty((_EVENTS + 2 * m, 3)),
            np.zeros(3, dtype=np.int64),
        )

    def _collect(self, record: Record) -> None:
        segments, rows, events = record.used
        if segments:
            self.segments.append(
                (
                    record.segment[:segments].copy(),
                    record.start[:segments].copy(),
                    record.series[:rows].copy(),
                )
            )
        self.events.append(record.event[:events].copy())
        self.when.append(record.when[:events].copy())


@kernel
def _resolve_nodes(arrays: Any, laws: Any, state: Any, scratch: Any) -> int:
    """Choose the modes of the nodes at the start; stop at a node that has no admissible modes."""
    for j in range(arrays.node_dof.shape[0] - 1):
        state.whole[codes.NODE], state.whole[codes.FIRED], state.real[codes.AT] = j, -1, 0.0
        code = call_kernel(state.kernels[codes.JOINT_CHOICE], (arrays, laws, state, scratch))
        if code != 0:
            state.flags[WHERE] = j
            return code
    return codes.DONE


def reach_kernels(state: State, *packs: Any) -> None:
    """Compile the large kernels if necessary, and store their addresses for other kernels."""
    state.kernels[: codes.BERNSTEIN] = [
        kernel_address(function, *packs) for function in (expand, step_length_kernel, choose_jointly)
    ]


def new_state(built: Built, order: int) -> State:
    """Return a new state of the run, with zeros."""
    arrays = built.arrays
    nodes, n, m = len(arrays.node_dof) - 1, len(arrays.dof_node), len(arrays.con_node)
    leaves = 1 << max(m, 1).bit_length()
    ints: dict[str, Any] = {"dtype": np.int64}
    return State(
        x=np.zeros((2, n)), series=padded_rows(order + 1, -(-n // WIDTH) * WIDTH), origin=np.zeros(nodes),
        mode=np.zeros(m, **ints), held=np.zeros(m, **ints), decree=np.zeros((m, 2), **ints), stamp=np.full(m, -1.0),
        until=np.full(m, codes.OPEN_END), guard=np.zeros(m, **ints), pinv=np.zeros(max(len(arrays.g_val), 1)),
        holds=np.zeros(nodes, **ints), pin=np.full(n, -1, **ints), anchor=np.full(m, -1, **ints),
        tree=np.full(2 * leaves, codes.OPEN_END), clock=np.array([0.0, 0.0, 0.0, math.nan]),
        phase=np.zeros(len(arrays.rates)),
        flags=np.zeros(LAST + WHERE + 1, **ints), counts=np.zeros(6, **ints), tolerance=np.ones((2, n)),
        kernels=np.zeros(codes.BERNSTEIN + LEADING, **ints), whole=np.zeros(7, **ints), real=np.zeros(4),
    )  # fmt: skip


def new_scratch(built: Built, order: int) -> Scratch:
    """Return new scratch arrays for the kernels."""
    arrays, laws = built.arrays, built.laws
    nodes, n, m = len(arrays.node_dof) - 1, len(arrays.dof_node), len(arrays.con_node)
    widest = max(int(np.diff(arrays.node_con).max(initial=0)), 2)
    columns, tapes = order + 1, len(laws.registers)
    registers = int(laws.registers.max(initial=0))
    ints: dict[str, Any] = {"dtype": np.int64}
    beside = WIDTH + int(abs(arrays.offsets).max(initial=0))  # lanes next to a run
    wide = -(-(max(n, m) + 2 * beside) // WIDTH) * WIDTH
    return Scratch(
        nodes=np.zeros(nodes, **ints), dofs=np.zeros(n, **ints), cons=np.zeros(m, **ints), loc=np.zeros(n, **ints),
        lcon=np.zeros(m, **ints), stamp=np.zeros(nodes + 1, **ints),
        Q=padded_rows(columns, wide, beside), R=padded_rows(columns, wide), F=padded_rows(columns, wide),
        acc=np.zeros(wide),
        trig=np.zeros((len(arrays.rates), 2, columns)), lane=np.zeros(m, **ints), lane_ptr=np.zeros(tapes + 1, **ints),
        place=np.zeros(tapes + 1, **ints), poly=np.zeros(columns),
        V=padded_rows(1, registers * columns * (m + WIDTH * tapes) + 1)[0],
        bern=np.zeros(columns), stack=np.zeros((64, columns + 2)), before=np.zeros(m, **ints),
        zero=np.zeros(m, **ints), at_limit=np.zeros(m, **ints), next=np.zeros(m, **ints),
        err=np.zeros((columns, n)), err_f=np.zeros((columns + 8, m)), square=np.zeros((widest, widest)),
        tall=np.zeros((widest, widest)), order=np.zeros(widest, **ints), exits=np.zeros(m), kinds=np.zeros(m, **ints),
        line=np.zeros(3 * TERMS), sums=padded_rows(4, wide),
        band_rows=padded_rows(1, (len(arrays.bands) + 3) * wide)[0],
        band_first=np.zeros(wide // WIDTH, **ints),
        W=padded_rows(1, (registers * columns + 1) * wide if len(arrays.offsets) else 1)[0],
    )  # fmt: skip
