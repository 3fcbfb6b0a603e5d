"""`hybridsim check MODEL`: read a model, report every fault, and print the automaton that it expands to."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from hybridsim.cli import values
from hybridsim.cli.output import Written, print_json

if TYPE_CHECKING:
    from hybridsim.engine.report import Report
    from hybridsim.model import Component, Guard, Mode, Model


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "check",
        help="check a model and print its automaton",
        description="Read a model, report every fault, and print the automaton that it expands to.",
    )
    values.add_model_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.set_defaults(execute=execute)


def execute(args: argparse.Namespace, written: Written) -> int:
    """Print the expanded automaton; a bad model has already been refused on loading."""
    from hybridsim.engine.report import describe

    model = values.changed_model(args)
    report = describe(model)
    if args.json:
        print_json(_record(model, report))
    else:
        print("\n".join([*_model_lines(model, report), "", *_engine_lines(report)]))
    return 0


def _model_lines(model: Model, report: Report) -> Iterator[str]:
    yield f"{model.name}: {model.title}" if model.title else model.name
    for label in ("source", "look"):
        if text := getattr(model, label):
            yield f"{label}: {' '.join(text.split())}"
    yield "\nparameters"
    numbers = model.parameter_values()
    for parameter in model.parameters:
        formula = parameter.value.text
        number = f"{numbers[parameter.name]:.12g}"
        shown = number if _same_number(formula, number) else f"{formula} = {number}"
        yield f"  {parameter.name} = {shown} {parameter.unit}".rstrip()
    yield "\nstates"
    starts = model.start_values()
    for state in model.states:
        yield f"  {state.name}' = {state.der.text}"
        yield f"      from {starts[state.name]:.12g} {state.unit}".rstrip()
    for component in model.all_components():
        yield from _component_lines(component, report)


def _same_number(text: str, number: str) -> bool:
    try:
        return float(text) == float(number)
    except ValueError:
        return False


def _engine_lines(report: Report) -> Iterator[str]:
    together = [", ".join(cluster) for cluster in report.clusters if len(cluster) > 1]
    yield f"decided together: {'; '.join(together) or 'no components'}"
    linear = [
        f"{name}.{mode}" if name else "the states" for name, modes in report.linear.items() for mode in modes
    ]
    yield f"linear: {', '.join(linear) or 'nothing'}"
    cost = f"about {report.compile_seconds:.1g} s, once" if report.compile_seconds else "nothing, it is known"
    yield f"compiling: {report.operations} operations, {cost}"


def _component_lines(component: Component, report: Report) -> Iterator[str]:
    starts = f"starts in {component.initial}" if component.initial else "starts as the initial state decides"
    yield f"\ncomponent {component.name} ({starts})"
    if surface := component.surface:
        yield (
            f"  surface {surface.function.text}: {surface.above} above, {surface.below} below, "
            f"{surface.hold} on it, solving for {surface.unknown}"
            + (f", {held} held exactly" if (held := report.held.get(component.name)) else "")
        )
    for mode in component.modes:
        yield f"  mode {mode.name}"
        yield from _mode_lines(mode)


def _mode_lines(mode: Mode) -> Iterator[str]:
    for variable, expression in mode.set.items():
        yield f"      {variable} = {expression.text}"
    for state, expression in mode.der.items():
        yield f"      {state}' = {expression.text}"
    for guard in mode.guards:
        yield f"      while {guard.expr.text} >= 0   ({guard.name})"
        yield from _choice_lines(guard)


def _choice_lines(guard: Guard) -> Iterator[str]:
    for choice in guard.then:
        condition = f"if {choice.when.text}: " if choice.when else ""
        reset = ", ".join(f"{name} := {value.text}" for name, value in choice.reset.items())
        yield f"          {condition}to {choice.to}" + (f" with {reset}" if reset else "")
    if guard.fatal:
        yield f"          else stops: {guard.fatal}"


def _record(model: Model, report: Report) -> dict[str, Any]:
    return {
        "name": model.name,
        "title": model.title,
        "parameters": model.parameter_values(),
        "states": model.start_values(),
        "components": {
            component.name: {
                "initial": component.initial,
                "modes": {
                    mode.name: {
                        "set": {name: value.text for name, value in mode.set.items()},
                        "der": {name: value.text for name, value in mode.der.items()},
                        "guards": {
                            guard.name: {
                                "expr": guard.expr.text,
                                "then": [choice.to for choice in guard.then],
                            }
                            for guard in mode.guards
                        },
                    }
                    for mode in component.modes
                },
            }
            for component in model.all_components()
        },
        "engine": asdict(report),
    }
