"""This module writes the structure of a model as text, which identifies generated code."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from hybridsim.expr import Expression
from hybridsim.model.parts.component import Component, Corner
from hybridsim.model.parts.inputs import Input
from hybridsim.model.parts.schedule import Schedule

if TYPE_CHECKING:
    from hybridsim.model.parts.model import Model


def structure(model: Model) -> str:
    """Return the structure of a model as text; models with equal texts share their generated code."""
    return "\n".join(_lines(model)) + "\n"


def _lines(model: Model) -> Iterator[str]:
    for parameter in model.parameters:
        yield f"parameter {parameter.name}"
    for state in model.states:
        yield f"state {state.name}: {state.der}"
    for discrete in model.discrete:
        yield f"discrete {discrete.name}"
    for signal in model.inputs:
        yield _input(signal)
    for name, expr in model.definitions:
        yield f"definition {name}: {expr}"
    for component in model.all_components():
        yield from _component(component)
    for monitor in model.monitors:
        yield f"monitor {monitor.name} {monitor.direction} {monitor.action}: {monitor.expr}" + _map(
            monitor.reset
        )
    for schedule in model.schedules:
        yield _schedule(schedule)
    for output in model.outputs:
        modes = "; ".join(f"{name} = {expr}" for name, expr in output.modes.items())  # in order of priority
        yield f"output {output.name}: {output.expr} {{{modes}}}"


def _component(component: Component) -> Iterator[str]:
    kind = "corner" if isinstance(component, Corner) else "component"
    yield f"{kind} {component.name} initial {component.initial}"
    if component.limit:
        yield f"  limit {component.limit.to} reset" + _map(component.limit.reset)
    surface = component.surface
    if surface:
        yield (
            f"  surface {surface.function}; {surface.unknown}; {surface.above}; {surface.below}; "
            f"{surface.hold}; {surface.jump_above}; {surface.jump_below}; {surface.unique}; "
            f"{surface.restitution}"
        )
    for mode in component.modes:
        yield f"  mode {mode.name}: set" + _map(mode.set) + " der" + _map(mode.der)
        for guard in mode.guards:
            yield f"    guard {guard.name}: {guard.expr} fatal {guard.fatal!r}"
            for choice in guard.then:
                yield f"      to {choice.to} when {choice.when}" + _map(choice.reset)


def _input(signal: Input) -> str:
    return f"input {signal.name}: {signal.kind} {signal.interpolation} {signal.shape}" + _map(
        signal.expressions
    )


def _schedule(schedule: Schedule) -> str:
    times = ", ".join(str(time) for time in schedule.times)
    clock = f"{schedule.start} {schedule.period} {schedule.count}"
    return f"schedule {schedule.name} [{times}] {clock} {schedule.terminate}" + _map(schedule.reset)


def _map(items: Mapping[str, Expression]) -> str:
    """Return the items of a mapping sorted by name, because their order has no meaning."""
    return " {" + "; ".join(f"{name} = {items[name]}" for name in sorted(items)) + "}"
