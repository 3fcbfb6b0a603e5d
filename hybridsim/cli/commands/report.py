"""`hybridsim report MODEL`: simulate a model and write the run as one page."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hybridsim.cli import options, outcome, values
from hybridsim.cli.commands import run
from hybridsim.cli.output import print_json, require_folder, require_writable, say
from hybridsim.cli.session import Session

_EXAMPLES = """\
examples:
  hybridsim report dfcs
  hybridsim report belt -p v_belt=0.3 --t-end 100 --out reports
"""


def add_to(commands: Any) -> None:
    """Add the command `report` to the parser."""
    parser = commands.add_parser(
        "report",
        help="simulate a model and write the run as one HTML page",
        description="Simulate a model and write one HTML page with its curves, modes, events and their reasons, its "
        "cost, and how to repeat it. The page needs no other file and no connection.",
        epilog=_EXAMPLES,
    )
    run.add_settings(parser)
    options.add_out(parser, "report-MODEL")
    options.add_json(parser, "the result", "the summary")
    parser.set_defaults(execute=execute, lighter=run.LIGHTER)


def execute(args: argparse.Namespace, session: Session) -> int:
    """Simulate the model and write the page; the exit code is 1 if the simulation failed."""
    settings = run.run_settings(args)
    model = values.changed_model(args)
    folder: Path = args.out or Path(f"report-{model.name}")
    require_folder(folder, "--out")
    path = folder / f"{model.name}.html"
    if folder.is_dir():
        require_writable(path, "--out")
    solution, cautions = run.simulated(model, settings, args, session)
    folder.mkdir(parents=True, exist_ok=True)
    session.wrote(solution.report(path))
    if args.json:
        print_json(outcome.record(solution))
    else:
        say("\n".join(outcome.summary(solution)))
    return outcome.exit_code(solution, None, session, cautions)
