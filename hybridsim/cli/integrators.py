"""`hybridsim integrators`: what can run a model, when to choose which, and what each one lacks."""

from __future__ import annotations

import argparse
import textwrap
from typing import Any

from hybridsim.cli.output import print_json, print_table
from hybridsim.cli.session import Session


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "integrators",
        help="list the integrators and when to choose which",
        description="List what can run a model, when to choose which, and what each one lacks.",
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.set_defaults(execute=execute)


def execute(args: argparse.Namespace, session: Session) -> int:
    """List every integrator: its own and those that other packages registered."""
    import hybridsim
    from hybridsim.integrators.base import CAPABILITIES

    found = hybridsim.list_integrators()
    if args.json:
        print_json(
            [
                {
                    "name": each.name,
                    "title": each.title,
                    "order": each.order,
                    "when": each.when,
                    "lacks": dict(each.lacks),
                    "reference": each.reference,
                }
                for each in found
            ]
        )
        return 0
    print_table(
        ("INTEGRATOR", *CAPABILITIES),
        [(each.name, *("-" if c in each.lacks else "yes" for c in CAPABILITIES)) for each in found],
    )
    for each in found:
        print()
        print(f"{each.name}: {each.title} (order {each.order})")
        _paragraph(f"choose it: {each.when}")
        for capability, reason in each.lacks.items():
            _paragraph(f"lacks {capability}: {reason}")
        _paragraph(f"reference: {each.reference}")
    return 0


def _paragraph(text: str) -> None:
    print(textwrap.fill(text, width=100, initial_indent="    ", subsequent_indent="        "))
