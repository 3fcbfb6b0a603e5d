"""This module describes a model as text: quantities, hybrid automaton, events and compiled code."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from hybridsim.expr import assignment
from hybridsim.model.checks.units import label_of
from hybridsim.model.parts.inputs import HeldInput
from hybridsim.model.parts.switching import ATTRACTION
from hybridsim.model.smoothing.nonsmooth import COMPONENT, MODE, POWER, SURFACE, TIMED, UNCHANGED

if TYPE_CHECKING:
    from hybridsim.engine.run.report import Report
    from hybridsim.expr import Expression
    from hybridsim.model import Component, Guard, Input, Mode, Model, Monitor, Schedule
    from hybridsim.model.smoothing.nonsmooth import Primitive


def lines_of(
    model: Model, report: Report | None, primitives: Iterable[Primitive], facts: Iterable[str]
) -> Iterator[str]:
    """Yield the description of a model, line by line."""
    yield f"{model.name}: {model.title}" if model.title else model.name
    for label in ("source", "look"):
        if text := getattr(model, label):
            yield from textwrap.wrap(f"{label}: {text}", width=100, subsequent_indent="  ")
    yield from _section("parameters", _parameters(model))
    yield from _section("states", _states(model))
    yield from _section("discrete states", _discrete(model))
    yield from _section("definitions", (f"{name} = {_flat(value)}" for name, value in model.definitions))
    yield from _section("inputs", map(_input, model.inputs))
    laws = {contact.name: contact.law.name for contact in model.contacts}
    surfaces = {surface.name for surface in model.surfaces}
    for component in model.all_components():
        kind = "switching surface" if component.name in surfaces else "component"
        kind = "impact" if component.surface and component.surface.is_unilateral else kind
        kind = f"contact, law {laws[component.name]}" if component.name in laws else kind
        yield from _section(f"{component.name}: {kind}", _component(component, report))
    yield from _section("corners and jumps", map(_primitive, primitives))
    yield from _section("notes", facts)
    yield from _section("monitors", map(_monitor, model.monitors))
    yield from _section("schedules", map(_schedule, model.schedules))
    yield from _section("outputs", (f"{output.name} = {_flat(output.expr)}" for output in model.outputs))
    if report is not None:
        yield from _section("engine", _engine(report))


def _primitive(primitive: Primitive) -> str:
    """Return a line that describes how hybridsim treats a non-smooth expression."""
    text, remark = primitive.text, primitive.remark
    became = {
        COMPONENT: "two modes, continuous at the change of mode"
        + (f", shared with {remark}" if remark != text else ""),
        SURFACE: f"a jump at the switching surface {remark}",
        TIMED: f"a known function of time that switches at the zeros of {remark}",
        MODE: remark,
        UNCHANGED: f"not replaced by modes, {remark}; exact and taylor reject it",
        POWER: f"a fractional power, {remark}",
    }
    return f"{text} in {', '.join(primitive.where)}: {became[primitive.became]}"


def _flat(expression: Expression) -> str:
    """Return the text of an expression on one line, even if the model file has line breaks in it."""
    return " ".join(expression.text.split())


def _flat_reset(name: str, value: Expression, sign: str) -> str:
    return " ".join(assignment(name, value, sign).split())


def _section(title: str, lines: Iterable[str]) -> Iterator[str]:
    for i, line in enumerate(lines):
        if i == 0:
            yield f"\n{title}"
        yield f"  {line}"


def _parameters(model: Model) -> Iterator[str]:
    numbers = model.parameter_values()
    for parameter in model.parameters:
        formula = f"{_flat(parameter.value)} = " if parameter.value.names else ""
        yield f"{parameter.name} = {formula}{numbers[parameter.name]:.12g} {label_of(parameter.unit)}".rstrip()


def _states(model: Model) -> Iterator[str]:
    starts = model.start_values()
    for state in model.states:
        start = f"{starts[state.name]:.12g} {label_of(state.unit)}".rstrip()
        yield f"{state.name}' = {_flat(state.der)}   from {start}"


def _discrete(model: Model) -> Iterator[str]:
    starts = model.discrete_values()
    for part in model.discrete:
        held, start = isinstance(part, HeldInput), f"{starts[part.name]:.12g} {label_of(part.unit)}".rstrip()
        yield f"{part.name}   {'held input, ' if held else ''}from {start}"


def _input(declared: Input) -> str:
    if declared.kind == "table":
        return f"{declared.name}: table of {len(declared.times)} points, {declared.interpolation}"
    if declared.kind == "connected":
        return f"{declared.name}: connected by the model that uses this one as a part"
    numbers = ", ".join(f"{name} {_flat(value)}" for name, value in declared.expressions.items())
    return f"{declared.name}: {declared.shape or declared.kind}, {numbers}"


def _component(component: Component, report: Report | None) -> Iterator[str]:
    yield f"initial mode: {component.initial or 'from the initial state'}"
    sides: tuple[str, ...] = ()
    if surface := component.surface:
        sides = surface.modes
        held = report.held.get(component.name) if report else None
        projected = report.projected.get(component.name) if report else None
        beyond = (
            f"impact with restitution {_flat(surface.restitution)} when it reaches 0"
            if surface.restitution is not None
            else f"{surface.below} for {_flat(surface.function)} < 0"
        )
        yield (
            f"{surface.above} for {_flat(surface.function)} > 0, {beyond}; "
            f"in mode {surface.hold} the unknown {surface.unknown} keeps the function at 0"
            + (f" ({held} from the constraint)" if held else "")
            + (f" ({', '.join(projected)} projected onto the surface)" if projected else "")
            + (
                ""
                if held or projected or report is None
                else f"; the surface can only be crossed, because its rate does not depend on {surface.unknown}"
            )
        )
    if limit := component.limit:
        reset = ", ".join(_flat_reset(name, value, "=") for name, value in limit.reset.items())
        yield f"if its events accumulate: to {limit.to}" + (f" with {reset}" if reset else "")
    for mode in component.modes:
        linear = " (linear)" if report and mode.name in report.linear.get(component.name, ()) else ""
        yield f"mode {mode.name}{linear}"
        yield from (f"    {line}" for line in _mode(mode, [side for side in sides if side != mode.name]))


def _mode(mode: Mode, sides: list[str]) -> Iterator[str]:
    for variable, expression in mode.set.items():
        yield f"{variable} = {_flat(expression)}"
    for state, expression in mode.der.items():
        yield f"{state}' = {_flat(expression)}"
    for guard in mode.guards:
        text = _flat(guard.expr)
        attracts = text.startswith(ATTRACTION)
        yield f"while {'both sides point to the surface' if attracts else f'{text} >= 0'}   ({guard.name})"
        yield from (f"    {line}" for line in _then(guard, sides))


def _then(guard: Guard, sides: list[str]) -> Iterator[str]:
    for choice in guard.then:
        condition = f"if {_flat(choice.when)}: " if choice.when else ""
        yield f"{condition}to {choice.to}{_resets(choice.reset)}"
    if guard.fatal:
        yield f"otherwise the run stops: {guard.fatal}"
    elif not guard.then and sides:
        yield f"to the admissible mode of {', '.join(sides)}"


def _resets(reset: Mapping[str, Expression]) -> str:
    changes = ", ".join(_flat_reset(name, value, ":=") for name, value in reset.items())
    return f" with {changes}" if changes else ""


def _monitor(monitor: Monitor) -> str:
    does = _resets(monitor.reset).strip() or monitor.action
    return f"{monitor.name}: {_flat(monitor.expr)} through 0, {monitor.direction}: {does}"


def _schedule(schedule: Schedule) -> str:
    if schedule.times:
        when = "at " + ", ".join(_flat(time) for time in schedule.times)
    else:
        when = f"from {_flat(schedule.start) if schedule.start else '0'}"
        if schedule.period:
            when += f" every {_flat(schedule.period)}"
        if schedule.count:
            when += f", {schedule.count} times"
    return f"{schedule.name}: {when}{_resets(schedule.reset)}" + (
        ", ends the run" if schedule.terminate else ""
    )


def _engine(report: Report) -> Iterator[str]:
    clusters = [", ".join(cluster) for cluster in report.clusters]
    if clusters:
        yield f"contacts whose modes are selected together: {'; '.join(clusters)}"
    written = f", generated in {report.lowering_seconds:.1g} s" if report.lowering_seconds else ""
    cost = (
        f"compiled at the first run, in about {report.compile_seconds:.1g} s or less"
        if report.compile_seconds
        else "cached"
    )
    yield f"compiled code of this model: {cost} ({report.operations} operations{written})"
