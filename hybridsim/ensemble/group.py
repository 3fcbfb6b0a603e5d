"""This module prepares many runs of one model for compiled code, in groups with tables of equal shapes.

For a single run Python checks and binds the model and decides its start, which takes several times as long as a short
run of linear modes. Here this is done for all runs together.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.compiled.scratch import MAX_JOINT_COMPONENTS
from hybridsim.engine.linear.modes import holds_constants, is_always_linear
from hybridsim.engine.native.kernels import ENABLED, Precompiled
from hybridsim.engine.system.per_structure import spare_scratch
from hybridsim.engine.system.period import common_multiple
from hybridsim.engine.system.programs.mode_tables import automata_of, tape_cache_of
from hybridsim.engine.system.system import System
from hybridsim.ensemble.points import PeriodSummary, Points, summaries_of
from hybridsim.ensemble.scratch import GroupScratch
from hybridsim.ensemble.start import opposing
from hybridsim.ensemble.tables import EnsembleTables, ensemble_tables

_RENEWAL_TURNS = 100  # longest segment in turns of the fastest angle, as in `hybridsim.engine.run.setup`
_FULL_TURN = 2.0 * math.pi

_opposing = Precompiled(opposing)


class Group(NamedTuple):
    """The m points of a group, with the data for their runs."""

    numbers: np.ndarray  # numbers (m,) of the points
    tables: EnsembleTables  # kept alive for the kernels
    points: Points


def can_run_together(system: System) -> bool:
    """Return whether runs of a model can be computed together: the model has only contacts and linear modes.

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
    """Runs of one system at many values of its parameters and starts; each thread needs its own object.

    Parameters
    ----------
    system : one for which `can_run_together` is true at all values of its parameters.
    may_continue : called between groups and every few milliseconds; if it returns False, no more runs are started.
    """

    def __init__(self, system: System, may_continue: Callable[[], bool]) -> None:
        self.system, self.automata, self.may_continue = system, automata_of(system), may_continue
        self._first = np.zeros(len(system.automata), dtype=np.int64)
        self.tapes = tape_cache_of(system).with_complete_set()

    def groups(self, parameters: np.ndarray, starts: np.ndarray, size: int, periods: int) -> Iterator[Group]:
        """Yield the supported points in groups, until `may_continue` returns False.

        parameters (N, P), in the order of the model; starts (N, n). size: most points in a group. periods: length
        of the longest compiled call, in forcing periods.
        """
        for first in range(0, len(parameters), size):
            here = slice(first, first + size)
            for group in self._groups(parameters[here], starts[here], periods):
                yield group._replace(numbers=first + group.numbers)
            if not self.may_continue():
                return

    def _groups(self, parameters: np.ndarray, starts: np.ndarray, periods: int) -> Iterator[Group]:
        system, layout = self.system, self.system.layout
        vectors = np.zeros((len(parameters), layout.size))
        vectors[:, : layout.parameters] = parameters
        vectors[:, layout.pin_at] = 1.0
        rates = np.array([system.rates_at(p) for p in vectors]).reshape(len(vectors), -1, 2)
        known: dict[bytes, float] = {}
        for row in rates:
            if (key := row.tobytes()) not in known:
                known[key] = _period(row[:, 0])
        times = np.array([known[row.tobytes()] for row in rates])
        fastest = np.abs(rates[:, :, 0]).max(axis=1, initial=0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            longest = _RENEWAL_TURNS * _FULL_TURN / fastest
            horizons = np.minimum(periods * times, longest)
        fit = np.flatnonzero(np.isfinite(times) & self._may_begin(starts, vectors))
        groups = ensemble_tables(
            system, self.tapes.modes, np.ascontiguousarray(parameters[fit]), horizons[fit]
        )
        for tables in groups:
            numbers = fit[tables.numbers]
            of_points = (part[numbers] for part in (vectors, rates, starts, times, longest))
            yield Group(numbers, tables, Points(tables.addresses, *map(np.ascontiguousarray, of_points)))

    def summaries(self, group: Group) -> PeriodSummary:
        """Return uninitialised measures of the points of a group."""
        modes = max((len(automaton.modes) for automaton in self.system.automata), default=0)
        return summaries_of(len(group.numbers), self.system.n, len(self.system.automata), modes)

    @contextmanager
    def scratch(self, group: Group) -> Iterator[GroupScratch]:
        """Yield scratch arrays for a group of runs."""
        spare: deque[Any] = spare_scratch(self.system, "ensemble", group.tables.form)
        try:
            scratch = spare.pop()
        except IndexError:
            points, found = group.points, self.summaries(group)
            scratch = GroupScratch(self.system, self.tapes, group.tables.first(), points, found)
        yield scratch
        spare.append(scratch)

    def _may_begin(self, starts: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        """Return a mask (N,) of runs in which each contact opposes its own velocity."""
        found = np.empty(len(starts), dtype=np.bool_)
        scratch = np.zeros(len(self.system.surface_of))
        _opposing(self.system.address("effects"), starts, vectors, self._first, scratch, found)
        return found


def _period(rates: np.ndarray) -> float:
    """Return the common period of angles with given rates, or NaN if there is none."""
    return common_multiple((_FULL_TURN / abs(rates[rates != 0.0])).tolist()) or math.nan
