"""`hybridsim models`: list the packaged models, or the packaged friction laws."""

from __future__ import annotations

import argparse
from typing import Any

import hybridsim
from hybridsim.cli.output import print_json, print_table
from hybridsim.cli.session import Session
from hybridsim.model import list_laws, load_law


def add_to(commands: Any) -> None:
    """Add the command `models` to the parser."""
    parser = commands.add_parser(
        "models",
        help="list the models that come with hybridsim",
        description="List the models that can be run by name.",
    )
    parser.add_argument("--laws", action="store_true", help="list the friction laws instead")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.set_defaults(execute=execute)


def execute(args: argparse.Namespace, session: Session) -> int:
    """List the packaged models, or the packaged friction laws with their parameters."""
    if args.laws:
        _laws(args.json)
        return 0
    found = hybridsim.list_models()
    if args.json:
        print_json([{"name": info.name, "title": info.title} for info in found])
    else:
        print_table(("MODEL", "DESCRIPTION"), [(info.name, info.title) for info in found])
    return 0


def _laws(json: bool) -> None:
    laws = [load_law(name) for name in list_laws()]
    if json:
        print_json(
            [
                {
                    "name": law.name,
                    "title": law.title,
                    "source": law.source,
                    "parameters": list(law.parameters),
                    "states": [state.name for state in law.states],
                }
                for law in laws
            ]
        )
    else:
        rows = [(law.name, law.title, ", ".join(law.parameters)) for law in laws]
        print_table(("LAW", "DESCRIPTION", "PARAMETERS"), rows)
