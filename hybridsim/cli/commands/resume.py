"""`hybridsim resume FILE`: continue a saved run to its end time or to a later time."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import hybridsim
from hybridsim.cli import options, outcome, values
from hybridsim.cli.progress import Progress
from hybridsim.cli.session import Session

_EXAMPLES = """\
examples:
  hybridsim resume belt.hsol --save belt.hsol
  hybridsim resume belt.hsol --t-end 2e5 --plot belt.png
"""


def add_to(commands: Any) -> None:
    """Add the command `resume` to the parser."""
    parser = commands.add_parser(
        "resume",
        help="continue a saved run",
        description="Continue a run that 'hybridsim run --save' or sol.save() wrote to a file. The result equals that "
        "of a run that never stopped.",
        epilog=_EXAMPLES,
    )
    parser.add_argument("solution", metavar="FILE", type=Path, help="file of the saved run (.hsol)")
    options.add(parser, "--t-end", "TIME", "new end time (default: the end time of the saved run)")
    options.add_limit(parser)
    outcome.add_arguments(parser)
    parser.set_defaults(
        execute=execute, lighter="a shorter --t-end, or --limit megabytes=1000 to stop with a partial result"
    )


def execute(args: argparse.Namespace, session: Session) -> int:
    """Load the run, continue it, and write the output; the exit code is 1 if the simulation failed."""
    outcome.check_arguments(args)

    solution = hybridsim.load_solution(args.solution)
    outcome.check_drawing(solution.model, args)
    t_end = None if args.t_end is None else values.end_time(solution.model, args.t_end)
    with Progress(session) as progress, session.stopping_gently():
        further = outcome.as_far_as_it_came(
            lambda: solution.resume(t_end, limits=outcome.limits(args), progress=progress)
        )
    return outcome.deliver(further, args, session)
