"""This module declares the options that several commands share."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from hybridsim.cli import values
from hybridsim.cli.output import require_writable

PICTURES = (".png", ".pdf", ".svg")
ANIMATIONS = (".gif", ".html", ".mp4")
_UNNAMED = Path()  # value of --plot without a file name


def add(
    parser: argparse.ArgumentParser,
    name: str,
    metavar: str,
    text: str,
    kind: Callable[[str], Any] = str,
    **more: Any,
) -> None:
    """Add an option with a name, a placeholder for its value, a help text, and a function that reads the value."""
    parser.add_argument(name, metavar=metavar, help=text, type=kind, **more)


def add_repeated(
    parser: argparse.ArgumentParser,
    name: str,
    metavar: str,
    text: str,
    kind: Callable[[str], Any] = values.assignment,
    **more: Any,
) -> None:
    """Add an option that may occur several times; its values become a list."""
    add(parser, name, metavar, text, kind, action="append", **({"default": []} | more))


def add_model_arguments(parser: argparse.ArgumentParser, optional: bool = False) -> None:
    """Add the arguments for a model, its parameters and its initial values."""
    parser.add_argument(
        "model",
        metavar="MODEL",
        nargs="?" if optional else None,
        help="name of a model (see: hybridsim models) or path of a .toml file",
    )
    parser.add_argument(
        "-p",
        "--param",
        metavar="NAME=VALUE",
        type=values.assignment,
        action="append",
        default=[],
        help="set a parameter (for a state or a held input use --x0); VALUE may be an expression of other parameters, "
        "such as 'omega=0.6*sqrt(k/m)'; CONTACT.NAME=VALUE sets an argument of the friction law of a contact",
    )
    add_repeated(
        parser,
        "--x0",
        "NAME=VALUE",
        "set the initial value of a state or of a held input; VALUE may be an expression of parameters",
    )


def add_span_argument(parser: argparse.ArgumentParser, periods: int = values.DEFAULT_PERIODS) -> None:
    """Add the option for the end time."""
    add(
        parser,
        "--t-end",
        "TIME",
        "end of the run: a time, an expression of parameters, or '100T' for 100 forcing periods (default: the "
        f"duration in the model file, otherwise {periods}T; without a forcing period the end of the longest table or "
        f"chirp, otherwise {values.DEFAULT_SECONDS:g})",
    )


def add_integrator(parser: argparse.ArgumentParser) -> None:
    """Add the option that selects the integrator."""
    add(
        parser,
        "--integrator",
        "NAME",
        "name of an integrator (see: hybridsim integrators; default: auto)",
        default="auto",
    )


def add_limit(parser: argparse.ArgumentParser) -> None:
    """Add the option for limits of a run."""
    add_repeated(
        parser,
        "--limit",
        "NAME=VALUE",
        "stop the run, and keep its result, after this number of events, steps, seconds or megabytes",
    )


def add_rtol(parser: argparse.ArgumentParser, default: str) -> None:
    """Add the option for the relative tolerance; `default` is the text of the default in the help."""
    add(parser, "--rtol", "TOL", f"relative tolerance (default: {default})", values.positive)


def add_workers(parser: argparse.ArgumentParser, of: str = "") -> None:
    """Add the option for the number of threads; `of` is appended to its help text."""
    add(parser, "--workers", "N", f"number of threads{of} (default: one per processor)", values.workers)


def add_budget(parser: argparse.ArgumentParser, default: str) -> None:
    """Add the option for the total time limit."""
    add(
        parser,
        "--budget",
        "SECONDS",
        f"total time limit (default: {default}); settings that do not fit are skipped and listed",
        values.positive,
    )


def add_out(parser: argparse.ArgumentParser, default: str) -> None:
    """Add the option for the folder of the results."""
    add(parser, "--out", "FOLDER", f"folder for the results (default: ./{default})", values.folder)


def add_plot(parser: argparse.ArgumentParser, what: str) -> None:
    """Add the option that writes a picture; `what` is the plotted quantity in the help text."""
    add(
        parser,
        "--plot",
        "FILE",
        f"plot {what} to a {', '.join(PICTURES)} file (default: the name of the model or file with .png)",
        Path,
        nargs="?",
        const=_UNNAMED,
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
