"""`hybridsim schema`: print the JSON Schema of model files, for completion and checks in editors."""

from __future__ import annotations

import argparse
import json
from importlib.resources import files
from typing import Any

from hybridsim.cli.output import print_json
from hybridsim.cli.session import Session


def add_to(commands: Any) -> None:
    """Add the command `schema` to the parser."""
    parser = commands.add_parser(
        "schema",
        help="print the JSON Schema of model files",
        description="Print the JSON Schema of model files, with which editors complete and check them.",
        epilog="hybridsim schema > model.schema.json, and '#:schema ./model.schema.json' as the first line of a model",
    )
    parser.set_defaults(execute=execute)


def execute(args: argparse.Namespace, session: Session) -> int:
    """Print the schema file of the package."""
    schema = files("hybridsim.model.toml").joinpath("model.schema.json").read_text(encoding="utf-8")
    print_json(json.loads(schema))
    return 0
