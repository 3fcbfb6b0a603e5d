"""This module checks monitors, schedules and inputs without evaluating them."""

from __future__ import annotations

import math

from hybridsim.errors import nearest
from hybridsim.model.checks.automata import check_reset
from hybridsim.model.checks.scope import Scope
from hybridsim.model.parts.component import DIRECTIONS
from hybridsim.model.parts.inputs import INTERPOLATIONS, KINDS, OPTIONAL, REQUIRED, SHAPES, Input
from hybridsim.model.parts.monitor import ACTIONS, Monitor
from hybridsim.model.parts.schedule import Schedule


def check_signals(scope: Scope) -> None:
    """Report incomplete or contradictory monitors, schedules and inputs."""
    for monitor in scope.model.monitors:
        _monitor(scope, monitor)
    for schedule in scope.model.schedules:
        _schedule(scope, schedule)
    for signal in scope.model.inputs:
        _input(scope, signal)


def _monitor(scope: Scope, monitor: Monitor) -> None:
    what = f"monitor {monitor.name}"
    for field, value, known in (
        ("direction", monitor.direction, DIRECTIONS),
        ("action", monitor.action, ACTIONS),
    ):
        if value not in known:
            scope.unknown(monitor, f"{what}: unknown {field}", value, known, f"{field}s")
    check_reset(scope, monitor, what, monitor.reset)
    if bool(monitor.reset) != (monitor.action == "reset"):
        found = "a reset" if monitor.reset else "nothing to reset"
        scope.fail(
            monitor,
            f"{what} has action '{monitor.action}' and {found}",
            'use action = "reset" together with reset = {...}',
        )


def _schedule(scope: Scope, schedule: Schedule) -> None:
    what = f"schedule {schedule.name}"
    check_reset(scope, schedule, what, schedule.reset)
    if schedule.times and (schedule.start or schedule.period):
        scope.fail(
            schedule,
            f"{what} has 'times' together with 'start' or 'period'",
            "use either 'times', or both 'start' and 'period'",
        )
    if not schedule.times and schedule.start is None:
        scope.fail(
            schedule,
            f"{what} has neither 'times' nor 'start'",
            "set either 'times', or both 'start' and 'period'",
        )
    if schedule.count is not None:
        if schedule.period is None:
            scope.fail(schedule, f"{what} has count = {schedule.count} but no 'period'", "set 'period'")
        if schedule.count < 1:
            scope.fail(schedule, f"{what}: 'count' cannot be {schedule.count}", "use a whole number >= 1")


def _input(scope: Scope, signal: Input) -> None:
    what = f"input {signal.name}"
    if signal.kind not in KINDS:
        scope.unknown(signal, f"{what}: unknown kind", signal.kind, KINDS, "kinds")
        return
    for kind in KINDS:
        for field in (*REQUIRED[kind], *OPTIONAL[kind]):
            has_field = getattr(signal, field) not in (None, ())
            if has_field and field not in (*REQUIRED[signal.kind], *OPTIONAL[signal.kind]):
                scope.fail(signal, f"{what} of kind {signal.kind} cannot have '{field}'", f"remove '{field}'")
    for field in REQUIRED[signal.kind]:
        if getattr(signal, field) in (None, ()):
            scope.fail(signal, f"{what} of kind {signal.kind} needs '{field}'", f"set '{field}'")
    if signal.shape is not None and signal.shape not in SHAPES:
        scope.unknown(signal, f"{what}: unknown shape", signal.shape, SHAPES, "shapes")
    if signal.duty is not None and signal.shape != "square":
        scope.fail(signal, f"{what}: shape '{signal.shape}' cannot have 'duty'", "remove 'duty'")
    if signal.interpolation is not None and signal.interpolation not in INTERPOLATIONS:
        remedy = nearest(signal.interpolation, INTERPOLATIONS, kind="interpolations")
        scope.fail(signal, f"{what}: unknown interpolation '{signal.interpolation}'", remedy)
    if signal.kind == "table":
        _table(scope, signal, what)


def _table(scope: Scope, signal: Input, what: str) -> None:
    times, values = signal.times, signal.values
    if len(times) != len(values):
        scope.fail(
            signal,
            f"{what}: 'times' has {len(times)} numbers, but 'values' has {len(values)}",
            "use one value for each time",
        )
    if len(times) < 2:
        scope.fail(signal, f"{what} has {len(times)} points", "a table needs at least two points")
    for name, numbers in (("times", times), ("values", values)):
        for index, number in enumerate(numbers):
            if not math.isfinite(number):
                scope.fail(signal, f"{what}: '{name}[{index}]' cannot be {number}", "use finite numbers")
                return
    for index in range(1, len(times)):
        jump = times[index] == times[index - 1]
        if times[index] < times[index - 1]:
            message = (
                f"{what}: the times decrease from {times[index - 1]!r} to {times[index]!r} at point {index}"
            )
            scope.fail(signal, message, "sort the table by time")
            return
        if jump and (signal.interpolation != "linear" or (index > 1 and times[index - 2] == times[index])):
            message = f"{what}: the time {times[index]!r} occurs more than once (point {index})"
            scope.fail(signal, message, "only a linear table may contain a time twice, which makes a jump")
            return
