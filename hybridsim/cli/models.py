"""`hybridsim models`: the models that can be run by name."""

from __future__ import annotations

import argparse
from typing import Any

from hybridsim.cli.output import print_json, print_table
from hybridsim.cli.session import Session


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "models",
        help="list the models that come with hybridsim",
        description="List the models that can be run by name.",
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.set_defaults(execute=execute)


def execute(args: argparse.Namespace, session: Session) -> int:
    """List name and title of every model."""
    import hybridsim

    found = hybridsim.list_models()
    if args.json:
        print_json([{"name": info.name, "title": info.title} for info in found])
    else:
        print_table(("MODEL", "WHAT IT IS"), [(info.name, info.title) for info in found])
    return 0
