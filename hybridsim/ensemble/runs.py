"""This module runs a model for many parameters and starts, and returns the last period of each run.

For a single run Python checks and binds the model and decides its start, which takes several times as long as a short
run of linear modes. Here this is done for all runs together, or in compiled code. The runs are those of
`hybridsim.integrators.closed_form.compiled_loop`; a run with an unusual event is left to it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.compiled.scratch import MAX_JOINT_COMPONENTS
from hybridsim.engine.events.compiled.start import surfaces_of
from hybridsim.engine.events.outcome import Outcome
from hybridsim.engine.events.state import HybridState
from hybridsim.engine.linear.modes import holds_constants, is_always_linear
from hybridsim.engine.linear.motion_summary import NODES, WEIGHTS, MotionSummary
from hybridsim.engine.native.kernels import ENABLED, Precompiled
from hybridsim.engine.native.struct_pack import address_in, opaque, packed, replaced
from hybridsim.engine.run.event_loop import LoopRecord, link_event_loop
from hybridsim.engine.run.method_kernels import NOT_LINEAR, CallArrays
from hybridsim.engine.system.per_structure import spare_scratch
from hybridsim.engine.system.period import common_multiple
from hybridsim.engine.system.programs.mode_tables import automata_of, tape_cache_of
from hybridsim.engine.system.system import System
from hybridsim.ensemble.run import NEXT, SEGMENTS, Runs, run_ensemble
from hybridsim.ensemble.start import opposing
from hybridsim.ensemble.tables import EnsembleTables, ensemble_tables
from hybridsim.integrators.closed_form.compiled_loop import ClosedFormKernels
from hybridsim.integrators.closed_form.segments import ClosedFormRows

_GROUP_SIZE = 128  # runs whose tables are made together, so that they fit in the processor's cache
_RENEWAL_TURNS = 100  # longest segment in turns of the fastest angle, as in `hybridsim.engine.run.setup`
_FULL_TURN = 2.0 * math.pi

_run, _opposing = Precompiled(run_ensemble), Precompiled(opposing)


class LastPeriods(NamedTuple):
    """The measures of the last forcing periods of some runs."""

    numbers: np.ndarray  # numbers (m,) of the runs
    periods: np.ndarray  # lengths (m,) of the periods
    summary: MotionSummary  # the motion over the period, one row of each array per run


def can_run_together(system: System) -> bool:
    """Return whether runs of a model can be computed together: it has only contacts and linear modes.

    Held values must be constants, because states that follow others are not supported here.
    """
    model = system.model
    parts = model.monitors or model.inputs or model.schedules or model.discrete or system.stop_couplings
    return (
        ENABLED
        and system.has_tape
        and system.n > 0
        and not parts
        and all(a.has_surface and not (a.is_unique or a.is_unilateral) for a in system.automata)
        and len(system.automata) <= MAX_JOINT_COMPONENTS  # all tapes exist from the start
        and is_always_linear(system)
        and holds_constants(system)
    )


class Ensemble:
    """Runs of one system over a number of forcing periods; each thread needs its own object.

    Parameters
    ----------
    system : one for which `can_run_together` is true at all values of its parameters.
    may_continue : called every few milliseconds; if it returns False, no more runs are started.
    """

    def __init__(self, system: System, may_continue: Callable[[], bool]) -> None:
        self.system, self.automata, self.may_continue = system, automata_of(system), may_continue
        self.inputs = system.registers.inputs
        self.first = np.zeros(len(system.automata), dtype=np.int64)
        tape_cache = tape_cache_of(system)
        tape_cache.surround(self.first)
        self.tapes = tape_cache.tapes
        layout, self.surfaces = system.layout, surfaces_of(system)
        self.vector_positions = layout.origin_at, layout.phases_at, layout.pin_at
        self.hold = np.array([a.hold for a in system.automata], dtype=np.int64)

    def runs(self, parameters: np.ndarray, starts: np.ndarray, periods: int) -> Iterator[LastPeriods]:
        """Yield the last periods of all supported runs, in any order.

        parameters (N, P), in the order of the model; starts (N, n). The iteration ends early if `may_continue` returns
        False.
        """
        for first in range(0, len(parameters), _GROUP_SIZE):
            here = slice(first, first + _GROUP_SIZE)
            for last in self._runs(parameters[here], starts[here], periods):
                yield last._replace(numbers=first + last.numbers)
            if not self.may_continue():
                return

    def _runs(self, parameters: np.ndarray, starts: np.ndarray, periods: int) -> Iterator[LastPeriods]:
        system, layout = self.system, self.system.layout
        vectors = np.zeros((len(parameters), layout.size))
        vectors[:, : layout.parameters] = parameters
        vectors[:, layout.pin_at] = 1.0
        rates = np.array([system.rates_at(p) for p in vectors]).reshape(len(vectors), -1)
        known, which = np.unique(rates, axis=0, return_inverse=True)
        times = np.array([_period(row) for row in known])[which.reshape(-1)]
        fastest = np.abs(rates).max(axis=1, initial=0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            longest = _RENEWAL_TURNS * _FULL_TURN / fastest
            horizons = np.minimum(periods * times, longest)
        fit = np.flatnonzero(np.isfinite(times) & self._may_begin(starts, vectors))
        groups = ensemble_tables(
            system, self.tapes.modes, np.ascontiguousarray(parameters[fit]), horizons[fit]
        )
        for group in groups:
            numbers = fit[group.numbers]
            m, n, count = len(numbers), system.n, len(self.hold)
            runs = Runs(
                tables=group.addresses,
                vectors=vectors[numbers],
                rates=rates[numbers],
                starts=np.ascontiguousarray(starts[numbers]),
                ends=periods * times[numbers],
                periods=times[numbers],
                longest=longest[numbers],
                done=np.zeros(m, dtype=np.bool_),
                extremes=np.empty((m, 2, n)),
                integrals=np.empty((m, 2, n)),
                sides=np.empty((m, 2, n)),
                held=np.empty((m, 2, count)),
                holding=np.empty((m, 2, count), dtype=np.bool_),
                at=np.zeros(4, dtype=np.int64),
            )
            self._run_group(group, runs)
            summary = MotionSummary(runs.extremes, runs.integrals, runs.sides, runs.held, runs.holding)
            yield LastPeriods(
                numbers[runs.done],
                runs.periods[runs.done],
                MotionSummary(*(part[runs.done] for part in summary)),
            )

    def _run_group(self, group: EnsembleTables, runs: Runs) -> None:
        """Run all points of a group, until `may_continue` returns False."""
        spare = spare_scratch(self.system, "ensemble", group.form)
        try:
            group_scratch = spare.pop()
        except IndexError:
            group_scratch = _GroupScratch(self, group.first, runs.vectors[0])
        under_way = packed(runs)
        while True:
            _run(
                replaced(group_scratch.model, lin=group.first), group_scratch.lin_at, NOT_LINEAR,
                self.vector_positions, self.surfaces, self.hold, (NODES, WEIGHTS), under_way, group_scratch.slopes,
                *group_scratch.packs,
            )  # fmt: skip
            if runs.at[NEXT] == len(runs.ends) or not self.may_continue():
                break
        spare.append(group_scratch)

    def _may_begin(self, starts: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        """Return a mask (N,) of runs in which each contact opposes its own velocity."""
        found = np.empty(len(starts), dtype=np.bool_)
        scratch = np.zeros(len(self.system.surface_of))
        _opposing(self.system.address("effects"), starts, vectors, self.first, scratch, found)
        return found


def _period(rates: np.ndarray) -> float:
    """Return the common period of angles with given rates, or NaN if there is none."""
    return common_multiple((_FULL_TURN / abs(rates[rates != 0.0])).tolist()) or math.nan


class _GroupScratch:
    """Scratch arrays for runs with tables of equal shapes, and packs of the arrays."""

    def __init__(self, ensemble: Ensemble, tables: Any, p: np.ndarray) -> None:
        system = ensemble.system
        n, widest, count, whole = system.n, tables.values.shape[1], len(ensemble.hold), np.int64
        none, guards = np.zeros(0, dtype=whole), system.guard_count
        blank = Outcome(
            np.zeros(n), p.copy(), np.zeros(count, dtype=whole), np.ones(guards, dtype=whole),
            np.zeros(guards, dtype=whole), none, none, np.zeros(n), np.zeros(guards), np.zeros(0),
        )  # fmt: skip
        kernels = ClosedFormKernels(system, math.inf)
        kernels.lin = tables
        arrays = CallArrays(kernels, HybridState.of(blank, p), ensemble.tapes, tables)
        size = 2 * SEGMENTS
        record = LoopRecord(
            clocks=np.empty((size, 2)),
            modes=np.empty((size, count), dtype=whole),
            vectors=np.empty((size, system.layout.size)),
            last_steps=np.empty(size, dtype=whole),
            fires=np.empty(size, dtype=whole),
            jumps=np.empty((size, 3, n)),
        )
        rows = ClosedFormRows(
            ends=np.empty(size),
            rows=np.empty(size, dtype=whole),
            coordinates=np.empty((size, widest), dtype=complex),
        )
        found = MotionSummary(
            extremes=np.empty((2, n)),
            integrals=np.empty((2, n)),
            ends=np.empty((2, n)),
            held=np.empty((2, count)),
            holding=np.empty((2, count), dtype=np.bool_),
        )
        late, late_rows = (packed(type(part)(*(a[SEGMENTS:] for a in part))) for part in (record, rows))
        link_event_loop(
            kernels.loop,
            arrays.model,
            arrays.call,
            arrays.as_packed,
            arrays.work,
            late,
            arrays.own,
            late_rows,
        )
        self.model, self.rows = arrays.model, late_rows
        self.lin_at = address_in(arrays.model, "lin")
        self.packs = (
            arrays.as_packed, arrays.work, arrays.call, arrays.own, (late, opaque(arrays.own), opaque(late_rows)),
            (packed(record), packed(rows)), packed(found),
        )  # fmt: skip
        self.slopes = np.zeros((3, n))
