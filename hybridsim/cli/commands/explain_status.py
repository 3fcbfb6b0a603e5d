"""`hybridsim explain-status WORDS`: print the meaning of a status or a warning, and the remedy."""

from __future__ import annotations

import argparse
from typing import Any

from hybridsim.cli.output import say
from hybridsim.cli.session import Session


def add_to(commands: Any) -> None:
    """Add the command `explain-status` to the parser."""
    parser = commands.add_parser(
        "explain-status",
        help="explain a status or a warning",
        description="Print what a status or a warning means, and what to do.",
        epilog="Without WORDS the command lists all statuses and the phrases by which it finds warnings.",
    )
    parser.add_argument(
        "message", metavar="WORDS", nargs="*", help="a status, a warning, or a part of a warning"
    )
    parser.set_defaults(execute=execute)


def execute(args: argparse.Namespace, session: Session) -> int:
    """Print one section of the explanations, or the list of their headings."""
    from hybridsim.presentation.statuses import explanation, explanations

    say(explanation(" ".join(args.message)).rstrip() if args.message else "\n".join(explanations()))
    return 0
