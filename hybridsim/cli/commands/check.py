"""`hybridsim check MODEL`: report errors and suspicious parts, and print the hybrid automaton."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from hybridsim.cli import options, values
from hybridsim.cli.output import complain, print_json, print_table, say
from hybridsim.cli.session import Session
from hybridsim.errors import Place
from hybridsim.files import fields_of
from hybridsim.presentation.automaton import lines_of

if TYPE_CHECKING:
    from hybridsim.engine.run.report import Report
    from hybridsim.expr import Expression
    from hybridsim.model import Mode, Model
    from hybridsim.model.checks.caution import Caution
    from hybridsim.model.smoothing.nonsmooth import Primitive


def add_to(commands: Any) -> None:
    """Add the command `check` to the parser."""
    parser = commands.add_parser(
        "check",
        help="check a model and print its modes",
        description="Read a model, report every error, warn about suspicious parts (guards that never fire, pulses "
        "that a step may miss, units that are missing or disagree), and print the hybrid automaton of the model.",
    )
    options.add_model_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument(
        "--flat",
        action="store_true",
        help="print the model as one TOML file, with the content of the parts ([use.NAME]) included",
    )
    parser.add_argument(
        "--units",
        action="store_true",
        help="print the unit of each quantity and expression, and whether it is declared, inferred, unknown or "
        "inconsistent",
    )
    parser.set_defaults(execute=execute)


def execute(args: argparse.Namespace, session: Session) -> int:
    """Print the automaton and the warnings of a model. The model was checked when it was loaded."""
    from hybridsim.engine.run.report import describe
    from hybridsim.model.checks.doubtful import warnings_of
    from hybridsim.model.checks.starting_facts import starting_facts
    from hybridsim.model.smoothing.explicit_corners import smoothing_of

    model = values.changed_model(args)
    if args.units:
        return _print_units(model, args.json)
    # a part alone has no engine: its equations are complete only inside another model
    report = None if any(signal.kind == "connected" for signal in model.inputs) else describe(model)
    cautions = warnings_of(model)
    primitives = smoothing_of(model).primitives
    facts = starting_facts(model)
    if args.flat:
        say(model.to_toml().rstrip())
    elif args.json:
        print_json(_record(model, report, cautions, primitives, facts))
    else:
        say("\n".join(lines_of(model, report, primitives, facts)))
    for caution in cautions:
        complain(f"warning: {caution}")
    return 0


def _print_units(model: Model, as_json: bool) -> int:
    """Print the units of a model, and warn where they disagree."""
    from hybridsim.model.units.faults import HEADER, unit_faults, unit_rows

    rows, faults = [*unit_rows(model)], [*unit_faults(model)]
    if as_json:
        keys = ("what", "unit", "known")
        units = [dict(zip(keys, row, strict=True)) for row in rows]
        print_json({"name": model.name, "units": units, "warnings": [*map(_caution_record, faults)]})
    elif rows:
        print_table(HEADER, rows)
    else:
        say(f"the model {model.name} declares no units")
    for fault in faults:
        complain(f"warning: {fault}")
    return 0


def _record(
    model: Model,
    report: Report | None,
    cautions: Iterable[Caution],
    primitives: Iterable[Primitive],
    facts: Iterable[str],
) -> dict[str, Any]:
    return {
        "name": model.name,
        "title": model.title,
        "parameters": model.parameter_values(),
        "states": model.start_values(),
        "components": {
            component.name: {
                "initial": component.initial,
                "limit": component.limit.to if component.limit else None,
                "modes": {mode.name: _mode_record(mode) for mode in component.modes},
            }
            for component in model.all_components()
        },
        "engine": asdict(report) if report else None,
        "primitives": [_primitive_record(primitive) for primitive in primitives],
        "notes": list(facts),
        "warnings": [_caution_record(caution) for caution in cautions],
    }


def _primitive_record(primitive: Primitive) -> dict[str, Any]:
    place = fields_of(primitive.place or Place(), "file", "line")
    return fields_of(primitive, "text", "where", "became", "remark") | place


def _caution_record(caution: Caution) -> dict[str, Any]:
    place = fields_of(caution.place or Place(), "file", "line")
    return {"message": caution.message, **place, "remedy": caution.remedy}


def _mode_record(mode: Mode) -> dict[str, Any]:
    return {
        "set": _texts(mode.set),
        "der": _texts(mode.der),
        "guards": {
            guard.name: {
                "expr": guard.expr.text,
                "fatal": guard.fatal,
                "then": [
                    {
                        "to": choice.to,
                        "when": choice.when.text if choice.when else None,
                        "reset": _texts(choice.reset),
                    }
                    for choice in guard.then
                ],
            }
            for guard in mode.guards
        },
    }


def _texts(expressions: Mapping[str, Expression]) -> dict[str, str]:
    return {name: expression.text for name, expression in expressions.items()}
