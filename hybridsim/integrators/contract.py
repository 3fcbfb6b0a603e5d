"""The interface of an integrator, for authors of methods: `Integrator`, its arguments and its results."""

from __future__ import annotations

from abc import ABCMeta
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import ClassVar

import numpy as np

from hybridsim.engine.events.compiled.scratch import called_by
from hybridsim.engine.native.kernels import call, inlined, kernel
from hybridsim.engine.record.trajectory import Task, Trajectory
from hybridsim.engine.roots.first_exit import FOUND, NEVER, OPEN
from hybridsim.engine.run.compiled_loop import CompiledLoop, compile_loops
from hybridsim.engine.run.event_loop import FOLLOWED, FULL, STOPPED, event_loop, not_followed
from hybridsim.engine.run.method_kernels import MethodKernels
from hybridsim.engine.run.single_call import run_task
from hybridsim.engine.run.stepping import Flow, Root, Step, Stepper, Watch
from hybridsim.engine.system.failures import StepFailure
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.integrators.one_step import OneStepStepper, Point, Trial
from hybridsim.integrators.polynomial_steps import (
    CONTINUES,
    PolynomialKernels,
    begin_segment,
    end_segment,
    first_zero,
    guards_at_end,
    next_step,
    project,
    put_sides,
    record_step,
)
from hybridsim.integrators.step_control import forget, next_length

__all__ = [
    "CAPABILITIES",
    "CONTINUES",
    "FOLLOWED",
    "FOUND",
    "FULL",
    "NEEDS_TAPE",
    "NEVER",
    "OPEN",
    "STOPPED",
    "CompiledLoop",
    "Flow",
    "Integrator",
    "MethodKernels",
    "OneStepStepper",
    "Point",
    "PolynomialKernels",
    "Root",
    "Step",
    "StepFailure",
    "Stepper",
    "System",
    "Task",
    "Tolerances",
    "Trajectory",
    "Trial",
    "Watch",
    "begin_segment",
    "call",
    "called_by",
    "compile_loops",
    "end_segment",
    "event_loop",
    "first_zero",
    "forget",
    "guards_at_end",
    "inlined",
    "kernel",
    "next_length",
    "next_step",
    "not_followed",
    "project",
    "put_sides",
    "record_step",
]

NEEDS_TAPE = "it needs rates that are declared as expressions"  # reason for lacks["functions"]
EXPLICIT = {"stiff": "it is explicit: the fastest rate limits its step"}  # entries of lacks
RESTARTED = {
    "accumulation": "it does not resolve events closer than its tolerances, since each restart is at order one"
}
CAPABILITIES = {
    "contacts": "contacts with dry friction that stick",
    "located": "events of contacts are located, with their right number and order",
    "impacts": "unilateral contacts with restitution",
    "sliding": "switching surfaces with sliding motions",
    "transitions": "general automata: modes, choices, resets",
    "monitors": "events that change no mode",
    "scheduled": "events and inputs at times known beforehand",
    "multiple-roots": "several zeros of a guard within one step",
    "accumulation": "infinitely many events in finite time, resolved down to rounding",
    "tangent-exit": "the end of sliding, at a tangency for instance, on a surface of several states",
    "poles": "motions that grow without bound in finite time",
    "exact-stick": "a held state stays exactly constant",
    "backward": "time running backward",
    "corners": "corners and jumps that remain inside a mode, such as a sign or a condition",
    "functions": "models whose rates are a Python function",
    "stiff": "time constants that differ by many orders of magnitude",
    "nonlinear": "flows and guards that are not linear in the states",
    "adaptive": "steps are controlled by rtol and atol",
}


class _IntegratorType(ABCMeta):
    """The metaclass of integrators; it makes the repr of an integrator class show the name and the order."""

    def __repr__(cls) -> str:
        name, title, order = (getattr(cls, key, "") for key in ("name", "title", "order"))
        return f"<integrator {name}: {title}, order {order}>" if name else super().__repr__()


class Integrator(metaclass=_IntegratorType):
    """Base class of all methods that integrate a piecewise-smooth system.

    The contract, most important rules first:

    1. An integrator is a frozen dataclass; its fields are its options, with defaults and types. It keeps no
       state between runs: all data of a run belong to the stepper.
    2. Implement ``start`` to step through smooth segments; the engine then locates, decides and resolves
       events. Or implement ``run`` for a whole run, as in a fixed-step method that makes its own decisions.
    3. ``start(flow, x0, s_bound, tolerances, first_step, watch)`` begins a segment at local time 0 in the
       state x0. The function ``flow.rhs(s, x)`` is smooth: no sign, no switch. No history of an earlier
       segment may be used. A segment whose first step contradicts the flow is begun again with a
       shorter ``first_step``.
    4. ``stepper.step()`` returns the next accepted `Step`, the last one ending exactly at ``s_bound``, or
       raises `StepFailure`. A trial in which a number is not finite is a rejected step, never an accepted
       one. s_bound is negative if time runs backward.
    5. ``step.dense(times)`` maps local times (k,) inside the step to states (k, n) and equals x0 and x1 at
       its ends. Set ``dense_is_accurate`` to whether it is as accurate as the method. If not, implement
       ``stepper.restep(step, s)``, the same step up to s exactly, which gives event times the accuracy of the
       method. If its error up to s is above the tolerance, return a shorter step, from whose end ``step()``
       continues; it is searched again.
    6. A method that finds zeros itself returns them in ``step.roots`` and ends its step at them; ``watch``
       contains the functions to monitor and their leading coefficients that are set to zero at the start.
    7. ``lacks`` lists missing capabilities: it maps a key of `CAPABILITIES` to the reason. A model that
       needs the capability is refused with that reason.
    8. Evaluate only through ``flow``, which counts evaluations. Count rejected steps in
       ``flow.counters.rejected``.
    9. `hybridsim.testing` tests any integrator against the event contract; run it on yours.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    order: ClassVar[str]
    reference: ClassVar[str]
    when: ClassVar[str]
    lacks: ClassVar[Mapping[str, str]] = MappingProxyType({})
    dense_is_accurate: ClassVar[bool] = False
    has_compiled_loop: ClassVar[bool] = False  # whether compiled_loop() may return one

    @property
    def stable_to(self) -> float:
        """Return the limit of |h*lambda| for stable steps of an explicit method, or 0 for other methods."""
        return 0.0

    @property
    def rounding(self) -> float:
        """Return the largest possible rounding error of a step, as a multiple of the rounding of its result."""
        return 100.0

    def prepare(self, system: System) -> None:
        """Compile everything that a run needs in addition to the model's functions."""
        return

    def start(
        self,
        flow: Flow,
        x0: np.ndarray,
        s_bound: float,
        tolerances: Tolerances,
        first_step: float | None,
        watch: Watch,
    ) -> Stepper:
        """Begin to integrate the motion up to the next event."""
        raise NotImplementedError(f"{self.name} has no start(), because the method run() takes all steps")

    def compiled_loop(self, system: System, tolerances: Tolerances, longest: float) -> CompiledLoop | None:
        """Return the compiled loop of this method for one run, or None if the model does not allow one."""
        return None

    def run(self, system: System, task: Task, progress: Callable[[float], None] | None = None) -> Trajectory:
        """Run a task, by default step by step through the mode loop of the engine."""
        return run_task(system, self, task, progress)
