"""This module recognises runs whose segments end in ordinary events only, and computes their passages.

At an ordinary event one guard of a friction contact, relay or hidden corner fires, one component changes its mode, and
no state jumps. Runs with other events are left to `hybridsim.analysis.variations.carried`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from hybridsim.analysis.variations.changes import are_zero, speed_along
from hybridsim.analysis.variations.compiled.passages import Passages, Points, gradients_at
from hybridsim.analysis.variations.smooth import Intervals
from hybridsim.analysis.variations.tapes import tangent_tape
from hybridsim.analysis.variations.values.vector_slopes import VectorSlopes
from hybridsim.engine.native.kernels import Precompiled
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.record.blocks import SegmentBlock
from hybridsim.engine.record.event_block import EventBlock
from hybridsim.engine.series.dual_numbers import Dual, differentiated_rows
from hybridsim.engine.series.tangent_panel import panel
from hybridsim.engine.system.per_structure import per_structure
from hybridsim.engine.system.system import System
from hybridsim.solution import Solution

_gradients_at = Precompiled(gradients_at)


class NotOrdinary(Exception):
    """Raised if a run contains an event or an instant that is not ordinary."""


@per_structure
def _plain_guards(system: System) -> np.ndarray:
    """Return for each guard whether its events are ordinary: they reset nothing and make no state jump."""
    plain = np.ones(system.guard_count, dtype=np.bool_)
    with_resets = {key[1:4] for key in system.resets if key[0] == "choice"}
    for c, automaton in enumerate(system.automata):
        jumps = automaton.is_unilateral or not (automaton.has_surface or automaton.is_corner)
        for m, numbers in enumerate(automaton.guards):
            for g, number in enumerate(numbers):
                plain[number] &= not jumps and (c, m, g) not in with_resets
    return plain


def guards_between(solution: Solution, slack: float) -> np.ndarray:
    """Return the guard (N,) that ends each of the N segments of a run, or -1 if no guard ends the segment.

    slack : time before the end of the run at which an instant counts as the end.
    """
    system, segments = solution._system, solution._segments
    if system.signals or not all(isinstance(block, SegmentBlock) for block in segments.blocks):
        raise NotOrdinary
    origins, spans, modes = segments.origins(), segments.spans(), segments.modes()
    guards = np.full(len(origins), -1)
    inner = origins[1:] + np.stack([spans[1:, 0], np.zeros(len(origins) - 1)], axis=1)
    if not (spans[:, 1] > spans[:, 0]).all() or spans[:, 0].any():
        raise NotOrdinary
    if len(inner) and segments[-1].end.minus(segments[-1].start) <= slack:
        raise NotOrdinary
    occurrences, found = solution._of_model.record.occurrences, 0
    for block in occurrences.blocks:
        if not isinstance(block, EventBlock):
            if any(one.kind != "near-grazing" for one in block):
                raise NotOrdinary
            continue
        events = block.single_transitions()
        if events is None or not _plain_guards(system)[events[1]].all():
            raise NotOrdinary
        instants, fired = events
        here = found + np.searchsorted(inner[found:, 0], instants[:, 0])
        if len(here) and (here[-1] >= len(inner) or (np.diff(here) <= 0).any()):
            raise NotOrdinary
        if (inner[here] != instants).any():
            raise NotOrdinary
        guards[here] = fired
        found = int(here[-1]) + 1 if len(here) else found
    changed = (modes[1:] != modes[:-1]).sum(axis=1)
    if (changed > (guards[:-1] >= 0)).any():
        raise NotOrdinary
    return guards


def are_of_the_model(system: System, guards: np.ndarray) -> np.ndarray:
    """Return which of some guards (N,) belong to a declared component, and not to a hidden corner."""
    found = np.zeros(len(guards), dtype=np.bool_)
    found[guards >= 0] = ~system.is_corner[system.owner[guards[guards >= 0]]]
    return found


class Passage:
    """Computes derivatives of ordinary events of a run, and derivatives of held states at both ends of each segment."""

    def __init__(self, solution: Solution, vector: VectorSlopes, moving: list[int]) -> None:
        self._system, self._vector, segments = solution._system, vector, solution._segments
        self._modes = segments.modes()
        self._vectors = np.concatenate([block.vectors for block in segments.blocks])
        index, s, x = segments.knots()
        first = np.flatnonzero(np.diff(index, prepend=-1))
        self._ends = [(s[at], x[at]) for at in (first, np.append(first[1:], len(s)) - 1)]
        self._origins = self._vectors[:, self._system.layout.origin_at]
        self._chosen = [*range(self._system.n), *(self._system.n + 1 + k for k in moving)]
        fixed, by_origin = vector.seeds_and_rates()
        self._seeds = fixed, by_origin
        self._panel = panel(self._system.registers.count, fixed.shape[1])

    def _points(self, chosen: np.ndarray, end: int) -> Points:
        """Return the starts (0) or ends (1) of some segments."""
        s, x = self._ends[end]
        return Points(s[chosen], x[chosen], self._vectors[chosen], self._origins[chosen])

    def _gradients(self, z: np.ndarray, guards: tuple[int, ...], points: Points) -> Any:
        tape = tangent_tape(self._system, z, guards)
        count, width = len(points.s), self._seeds[0].shape[1]
        values, slopes = (
            np.empty((count, len(tape.outputs))),
            np.empty((count, len(tape.outputs), width)),
        )
        inputs = self._system.registers.inputs
        _gradients_at(
            tape.rows, inputs, tape.outputs, tuple(points), self._seeds, self._panel, values, slopes
        )
        if not np.isfinite(slopes[:, self._system.n :]).all():
            raise NotOrdinary
        return values, slopes[:, self._system.n :]

    def at_events(self, guards: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivatives (N, n + q) of event times, and the rates (N, n) before minus after each event."""
        n, modes = self._system.n, self._modes
        delays, jumps = np.zeros((len(modes), len(self._chosen))), np.zeros((len(modes), n))
        events = np.flatnonzero(guards >= 0)
        for here in _alike(np.concatenate([modes[events], guards[events, None]], axis=1)):
            at = events[here]
            points = self._points(at, 1)
            values, slopes = self._gradients(modes[at[0]], (int(guards[at[0]]),), points)
            rates, slope = values[:, :n], slopes[:, 0]
            speed = speed_along(slope[:, :n], slope[:, n], rates)
            if not speed.all():
                raise NotOrdinary
            delays[at] = -slope[:, self._chosen] / speed[:, None]
            jumps[at] = self._on_constraints(modes[at[0]], points, rates)
        for here in _alike(np.concatenate([modes[events], modes[events + 1], guards[events, None]], axis=1)):
            at = events[here]
            points, z = self._points(at + 1, 0), modes[at[0] + 1]
            rates = self._gradients(z, (), points)[0][:, :n]
            jumps[at] -= self._on_constraints(z, points, rates)
            self._refuse_limits(modes[at[0]], z, int(guards[at[0]]), points)
        return delays, jumps

    def _refuse_limits(self, before: np.ndarray, z: np.ndarray, fired: int, points: Points) -> None:
        """Raise `NotOrdinary` if another limit of a component's force than the fired guard is reached exactly."""
        c, n = int(self._system.owner[fired]), self._system.n
        automaton = self._system.automata[c]
        limits = automaton.guards[automaton.hold] if automaton.below >= 0 else ()
        if before[c] == automaton.hold:  # else the number of the fired guard means another function
            limits = tuple(limit for limit in limits if limit != fired)
        if not limits:
            return
        held = z.copy()
        held[c] = automaton.hold
        values, slopes = self._gradients(held, limits, points)
        discrete = points.vectors[:, self._system.layout.discrete_slice]
        constants = np.broadcast_to(self._vector.constants(), (len(discrete), len(self._vector.constants())))
        numbers, times = np.concatenate([discrete, constants], axis=1), points.origins + points.s
        if are_zero(values[:, n:], slopes, values[:, :n], points.x, numbers, times).any():
            raise NotOrdinary

    def _on_constraints(self, z: np.ndarray, points: Points, rates: np.ndarray) -> np.ndarray:
        """Return the rates (m, n); held states move along their constraints."""
        if not self._system.holds(z):
            return rates
        time = Dual(points.s, np.ones((1, len(points.s))))
        states = [Dual(v, r[None]) for v, r in zip(points.x.T, rates.T, strict=True)]
        return self._projected(time, states, list(points.vectors.T), z, len(points.s))[:, :, 0]

    def held(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return a mask (N,) of segments with held states, and derivatives (N, n, n + q) at their starts and ends."""
        system, modes, n = self._system, self._modes, self._system.n
        holds, width = np.zeros(len(modes), dtype=np.bool_), len(self._chosen)
        maps = np.zeros((2, len(modes), n, width))
        fixed, by_origin = (each[:, self._chosen] for each in self._seeds)
        for at in _alike(modes) if system.can_hold else ():
            z = modes[at[0]]
            if not system.holds(z):
                continue
            holds[at] = True
            for end in (0, 1):
                points = self._points(at, end)
                states = [
                    Dual(v, np.broadcast_to(row[:, None], (width, len(at))))
                    for v, row in zip(points.x.T, fixed[:n], strict=True)
                ]
                numbers: list[Any] = [
                    Dual(v, row[:, None] + np.outer(by, points.origins))
                    for v, row, by in zip(points.vectors.T, fixed[n + 1 :], by_origin[n + 1 :], strict=True)
                ]
                numbers[system.layout.origin_at] = points.origins
                maps[end, at] = self._projected(points.s, states, numbers, z, len(at))
        return holds, maps[0], maps[1]

    def _projected(self, s: Any, states: list[Any], p: list[Any], z: np.ndarray, count: int) -> np.ndarray:
        """Return the derivatives (m, n, D) of the states; held states follow from their constraints."""
        module: Any = self._system.code.module
        out: list[Any] = [0.0] * self._system.n
        p[self._system.layout.pin_at] = 1.0  # held states follow from their constraints
        try:
            differentiated_rows(module.project)(s, states, p, z, out)
        except ValueError:  # a condition has different values at these points
            raise NotOrdinary from None
        width = len(states[0].slope)
        rows = [
            np.broadcast_to(one.slope, (width, count)) if isinstance(one, Dual) else np.zeros((width, count))
            for one in out
        ]
        return np.array(rows).transpose(2, 0, 1)


def passages_of(
    solution: Solution, vector: VectorSlopes, moving: list[int], parts: Intervals, slack: float
) -> tuple[np.ndarray, Any]:
    """Return the guards (N,) that end the segments of a run with ordinary events only, and the packed `Passages`."""
    guards = guards_between(solution, slack)
    passage = Passage(solution, vector, moving)
    delays, jumps = passage.at_events(guards)
    holds, at_start, at_end = passage.held()
    first = np.searchsorted(parts.number, np.arange(len(guards) + 1))
    return guards, packed(Passages(first, parts.matrices, delays, jumps, holds, at_start, at_end))


def _alike(rows: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the row numbers of each group of equal rows."""
    if not len(rows):
        return
    _, group = np.unique(rows, axis=0, return_inverse=True)
    group = group.reshape(-1)
    order = np.argsort(group, kind="stable")
    yield from np.split(order, np.flatnonzero(np.diff(group[order])) + 1)
