"""This module declares the options that several commands share."""

from __future__ import annotations

import argparse
from pathlib import Path

from hybridsim.cli import values
from hybridsim.cli.output import require_writable

PICTURES = (".png", ".pdf", ".svg")
ANIMATIONS = (".gif", ".html", ".mp4")
_UNNAMED = Path()  # value of --plot without a file name


def add_integrator(parser: argparse.ArgumentParser) -> None:
    """Add the option that selects the integrator."""
    parser.add_argument(
        "--integrator",
        metavar="NAME",
        default="auto",
        help="name of an integrator (see: hybridsim integrators; default: auto)",
    )


def add_limit(parser: argparse.ArgumentParser) -> None:
    """Add the option for limits of a run."""
    parser.add_argument(
        "--limit",
        metavar="NAME=VALUE",
        type=values.assignment,
        action="append",
        default=[],
        help="stop the run, and keep its result, after this number of events, steps, seconds or megabytes",
    )


def add_rtol(parser: argparse.ArgumentParser, default: str) -> None:
    """Add the option for the relative tolerance; `default` is the text of the default in the help."""
    parser.add_argument(
        "--rtol", metavar="TOL", type=values.positive, help=f"relative tolerance (default: {default})"
    )


def add_workers(parser: argparse.ArgumentParser, of: str = "") -> None:
    """Add the option for the number of threads; `of` is appended to its help text."""
    parser.add_argument(
        "--workers",
        metavar="N",
        type=values.workers,
        help=f"number of threads{of} (default: one per processor)",
    )


def add_budget(parser: argparse.ArgumentParser, default: str) -> None:
    """Add the option for the total time limit."""
    parser.add_argument(
        "--budget",
        metavar="SECONDS",
        type=values.positive,
        help=f"total time limit (default: {default}); settings that do not fit are skipped and listed",
    )


def add_out(parser: argparse.ArgumentParser, default: str) -> None:
    """Add the option for the folder of the results."""
    parser.add_argument(
        "--out",
        metavar="FOLDER",
        type=values.folder,
        help=f"folder for the results (default: ./{default})",
    )


def add_plot(parser: argparse.ArgumentParser, what: str) -> None:
    """Add the option that writes a picture; `what` is the plotted quantity in the help text."""
    parser.add_argument(
        "--plot",
        metavar="FILE",
        nargs="?",
        const=_UNNAMED,
        type=Path,
        help=f"plot {what} to a {', '.join(PICTURES)} file (default: the name of the model or file with .png)",
    )


def check_plot(args: argparse.Namespace) -> None:
    """Fill in the default file name of the picture, and reject a file that cannot be written."""
    if args.plot == _UNNAMED:
        args.plot = Path(Path(getattr(args, "model", None) or args.solution).with_suffix(".png").name)
    if args.plot:
        require_writable(args.plot, "--plot", PICTURES)


def add_json(parser: argparse.ArgumentParser, what: str, instead: str = "the table") -> None:
    """Add the option that prints JSON; `what` and `instead` name the two possible outputs in its help text."""
    parser.add_argument("--json", action="store_true", help=f"print {what} as JSON instead of {instead}")
