"""`hybridsim integrators [NAME]`: list the integrators with their uses, limitations and options."""

from __future__ import annotations

import argparse
import textwrap
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from hybridsim.cli.output import print_json, print_table, say
from hybridsim.cli.session import Session
from hybridsim.files import fields_of

if TYPE_CHECKING:
    from hybridsim.integrators.options import Option


def add_to(commands: Any) -> None:
    """Add the command `integrators` to the parser."""
    parser = commands.add_parser(
        "integrators",
        help="list the integrators and their uses",
        description="List the integrators, their uses and their limitations, or describe one with its options.",
    )
    parser.add_argument(
        "name", metavar="NAME", nargs="?", help="describe only this integrator, with its options"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.set_defaults(execute=execute)


def execute(args: argparse.Namespace, session: Session) -> int:
    """List all integrators, including those from plug-ins, or describe one integrator with its options."""
    from hybridsim.integrators import integrator_class, list_integrators
    from hybridsim.integrators.contract import CAPABILITIES
    from hybridsim.integrators.options import options_of

    found = (integrator_class(args.name),) if args.name else list_integrators()
    if args.json:
        print_json(
            [
                {
                    **fields_of(each, "name", "title", "order", "when"),
                    "lacks": dict(each.lacks),
                    "reference": each.reference,
                    "options": [asdict(option) for option in options_of(each)],
                }
                for each in found
            ]
        )
        return 0
    _paragraph(f"Capabilities that a model may require: {', '.join(CAPABILITIES)}.", indent="")
    say()
    lacking = [[c for c in CAPABILITIES if c in each.lacks] for each in found]
    print_table(
        ("INTEGRATOR", "LACKS"),
        [(each.name, ", ".join(lacks) or "nothing") for each, lacks in zip(found, lacking, strict=True)],
    )
    for each in found:
        options = options_of(each)
        say()
        say(f"{each.name}: {each.title} (order {each.order})")
        _paragraph(f"use it for: {each.when}")
        for capability, reason in each.lacks.items():
            _paragraph(f"lacks {capability}: {reason}")
        _paragraph(f"reference: {each.reference}")
        if args.name:
            _options(options)
        elif options:
            _paragraph(f"options: {', '.join(option.name for option in options)}")
    return 0


def _options(options: tuple[Option, ...]) -> None:
    if not options:
        say("\nThis integrator has no options.")
    for option in options:
        default = option.default
        shown = (
            ""
            if default is None
            else f"; default {default:g}"
            if isinstance(default, float)
            else f"; default {default}"
        )
        say(f"\n--option {option.name}=... ({option.kind}{shown})")
        _paragraph(option.text)


def _paragraph(text: str, indent: str = "    ") -> None:
    say(textwrap.fill(text, width=100, initial_indent=indent, subsequent_indent=2 * indent))
