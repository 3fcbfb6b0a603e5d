"""Determine the modes and states that hold just after the start of a run."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from hybridsim.engine.events.compiled.start import compiled_start
from hybridsim.engine.events.outcome import Outcome, Situation
from hybridsim.engine.events.resolve import EventResolution
from hybridsim.engine.events.state import HybridState
from hybridsim.engine.native.kernels import Precompiled, kernel
from hybridsim.engine.record.trajectory import Task
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System
from hybridsim.expr import Expression, rounding_of

_CLOSE = (
    1e-9  # distance from a surface, relative to the largest state, that a holding mode at the start may have
)
# Largest number of starts cached by a system; runs that differ in method, tolerance or span often start alike.
_MAX_CACHED_STARTS = 64


def settled_start(system: System, task: Task, origin: Instant, due: tuple[int, ...]) -> Outcome:
    """Return the state just after the start of the run, after schedules that are due at the start."""
    key = task.beginning
    known = system.starts.get(key)
    if known is None:
        p = system.vector(origin, task.discrete, task.forward)
        at = Situation(0.0, task.x0.copy(), p, task.z0.copy(), start_errors(system, task.x0), 0.0, True)
        resets = [("schedule", k) for k in due]
        known = EventResolution(system, at, task.z0.copy(), task.forward).run((), resets)
        # the first side of a corner is not a change
        known.changes = [change for change in known.changes if not system.is_corner[change.component]]
        known.warnings = [*known.warnings, *_contradictions(system, task, p, known.z)]
        if len(system.starts) >= _MAX_CACHED_STARTS:
            system.starts.clear()
        system.starts[key] = known
    return known


def start_by_kernel(system: System, task: Task, origin: Instant) -> HybridState | None:
    """Return the state just after the start, computed by compiled code, or None if `settled_start` is needed."""
    if not task.forward or max(task.z0.tolist(), default=-1) >= 0:
        return None
    p = system.vector(origin, task.discrete)
    return compiled_start(system, task.x0, start_errors(system, task.x0), p)


def start_errors(system: System, x0: np.ndarray) -> np.ndarray:
    """Return error bounds (n,) of the initial states.

    The bound of an expression includes its evaluation and the numbers in it. The bound of another number is its own
    roundoff; whole numbers are exact. Bounds of guards include the roundoff of the numbers in them. The numbers inside
    Python functions are unknown, so their bounds assume a number of the size of the initial value.
    """
    errors = _roundoffs(x0)
    for i, start in system.model.once_per_expressions("computed starts", partial(_computed_starts, system)):
        if x0[i] == system.start_state({})[i]:
            errors[i] = max(errors[i], rounding_of(start, system.values))
    return errors if system.has_tape else errors + _roundoffs(x0)


def _roundoffs(numbers: np.ndarray) -> np.ndarray:
    """Return bounds of the roundoff of numbers; whole numbers are exact."""
    found = np.empty_like(numbers)
    _write_roundoffs(numbers, found)
    return found


@kernel
def write_roundoffs(numbers: Any, out: Any) -> None:
    """Write a bound of the roundoff of each number."""
    for i in range(numbers.shape[0]):
        out[i] = 0.0 if numbers[i] == np.rint(numbers[i]) else UNIT * abs(numbers[i])


_write_roundoffs = Precompiled(write_roundoffs)


def _computed_starts(system: System) -> list[tuple[int, Expression]]:
    """Return the initial values that are formulas instead of numbers, with the indices of their states."""
    starts = [state.start for state in system.model.states]
    return [(i, start) for i, start in enumerate(starts) if not isinstance(start.tree, ast.Constant)]


def _contradictions(system: System, task: Task, p: np.ndarray, z: np.ndarray) -> Iterator[str]:
    """Yield a warning for each requested mode that contradicts the initial state."""
    if not any(task.z0[c] >= 0 for c in system.surface_of):
        return
    x, free = task.x0, z.copy()
    for c in system.surface_of:  # a holding mode would project the state onto the surface
        free[c] = system.automata[c].above
    values = system.rows("surfaces", len(system.surface_of), np.zeros(1), x[None], p, free)[0].tolist()
    near = _CLOSE * np.abs(x).max(initial=0.0)
    for c, value in zip(system.surface_of, values, strict=True):
        automaton, mode = system.automata[c], task.z0[c]
        if mode < 0:
            continue
        begins = f"{automaton.name} begins in mode {automaton.modes[mode]}, as requested"
        message = f"{begins}, but the initial state "
        expected_sign = {automaton.above: 1.0, automaton.below: -1.0}.get(int(mode), math.nan)
        if mode == automaton.hold:
            held = free.copy()
            held[c] = mode
            there = system.project(0.0, x, p, held)
            if (np.abs(there - x) > _CLOSE * np.maximum(np.abs(there), np.abs(x))).any():
                how = f"has the surface value {value:.6g}" if abs(value) > near else "moves off its surface"
                yield f"{message}{how}: the state was projected onto the surface"
        elif value * expected_sign < -near:
            yield f"{message}has the surface value {value:.6g}, which does not belong to that mode"
