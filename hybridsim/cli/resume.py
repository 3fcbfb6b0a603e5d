"""`hybridsim resume FILE`: go on with a run that stopped early, or further than it was asked for."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from hybridsim.cli import outcome, values
from hybridsim.cli.progress import Progress
from hybridsim.cli.session import Session

_EXAMPLES = """\
examples:
  hybridsim resume belt.hsol --save belt.hsol
  hybridsim resume belt.hsol --t-end 2e5 --plot belt.png
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "resume",
        help="go on with a run from a file",
        description="Go on with a run that 'hybridsim run --save' or sol.save() has written, from its last event; the "
        "result is that of a run that never stopped.",
        epilog=_EXAMPLES,
    )
    parser.add_argument("solution", metavar="FILE", type=Path, help="what was saved (.hsol)")
    parser.add_argument(
        "--t-end", metavar="TIME", help="where to end (default: where the run should have ended)"
    )
    outcome.add_arguments(parser)
    parser.set_defaults(
        execute=execute, lighter="a shorter --t-end; --limit megabytes=1000 stops with what there is"
    )


def execute(args: argparse.Namespace, session: Session) -> int:
    """Load, go on, print the summary, write the files; 1 where the simulation did not succeed."""
    outcome.check_arguments(args)

    import hybridsim

    solution = hybridsim.load_solution(args.solution)
    t_end = None if args.t_end is None else values.end_time(solution.model, args.t_end)
    with Progress(session) as progress, session.stopping_gently():
        further = outcome.as_far_as_it_came(
            lambda: solution.resume(t_end, limits=outcome.limits(args), progress=progress)
        )
    return outcome.deliver(further, args, session)
