"""Options that several commands have, each declared once."""

from __future__ import annotations

import argparse
from pathlib import Path

from hybridsim.cli import values
from hybridsim.cli.output import require_writable

PICTURES = (".png", ".pdf", ".svg")
_UNNAMED = Path()  # --plot without a file


def add_integrator(parser: argparse.ArgumentParser) -> None:
    """Which integrator."""
    parser.add_argument(
        "--integrator", metavar="NAME", default="auto", help="see: hybridsim integrators (default: auto)"
    )


def add_rtol(parser: argparse.ArgumentParser, default: str) -> None:
    """How accurate; `default` says what holds without it."""
    parser.add_argument(
        "--rtol", metavar="TOL", type=values.positive, help=f"relative tolerance (default: {default})"
    )


def add_workers(parser: argparse.ArgumentParser, of: str = "") -> None:
    """How many threads, of what."""
    parser.add_argument(
        "--workers", metavar="N", type=values.workers, help=f"threads{of} (default: one for each processor)"
    )


def add_budget(parser: argparse.ArgumentParser, default: str) -> None:
    """How long all may take."""
    parser.add_argument(
        "--budget",
        metavar="SECONDS",
        type=values.positive,
        help=f"what all of it may take (default: {default}); what does not fit is left out, and said",
    )


def add_out(parser: argparse.ArgumentParser, default: str) -> None:
    """Where results go."""
    parser.add_argument(
        "--out",
        metavar="FOLDER",
        type=values.folder,
        help=f"folder of the results (default: {default}, here)",
    )


def add_plot(parser: argparse.ArgumentParser, what: str) -> None:
    """A picture of what, to a file."""
    parser.add_argument(
        "--plot",
        metavar="FILE",
        nargs="?",
        const=_UNNAMED,
        type=Path,
        help=f"draw {what} ({', '.join(PICTURES)}; default: NAME.png, after the model or the file)",
    )


def check_plot(args: argparse.Namespace) -> None:
    """Name the picture if the user did not, and refuse a file that cannot be written."""
    if args.plot == _UNNAMED:
        args.plot = Path(Path(getattr(args, "model", None) or args.solution).with_suffix(".png").name)
    if args.plot:
        require_writable(args.plot, "--plot", PICTURES)


def add_json(parser: argparse.ArgumentParser, what: str, instead: str = "the table") -> None:
    """What is printed as JSON, and instead of what."""
    parser.add_argument("--json", action="store_true", help=f"print {what} as JSON instead of {instead}")
