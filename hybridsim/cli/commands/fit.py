"""`hybridsim fit MODEL DATA.csv`: fit parameters and start values of a model to measurements."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import hybridsim
from hybridsim.cli import options, values
from hybridsim.cli.output import complain, print_json, say
from hybridsim.cli.progress import Progress
from hybridsim.cli.session import Session
from hybridsim.errors import SimulationError, UsageError

_EXAMPLES = """\
examples:
  hybridsim fit free-decay record.csv --unknown mu=0.1:0.6
  hybridsim fit brake.toml run1.csv run2.csv --unknown mu_s=0.2:0.9 --unknown k=1e3:1e6:log --plot fit.png
  hybridsim fit belt record.csv --unknown mu_s=0.2:0.9 --column position=x --noise x=1e-4 --starts 10
"""


def add_to(commands: Any) -> None:
    """Add the command `fit` to the parser."""
    parser = commands.add_parser(
        "fit",
        help="fit parameters of a model to measurements",
        description="Fit parameters and start values to measurements in CSV files. The first line of a file names its "
        "columns: t and quantities of the model. Each file is one experiment.",
        epilog=_EXAMPLES,
    )
    options.add_model_arguments(parser)
    parser.add_argument(
        "data", metavar="DATA.csv", nargs="+", type=Path, help="measurements, one file per experiment"
    )
    options.add_repeated(
        parser,
        "--unknown",
        "NAME=LOW:HIGH[:log]",
        "an unknown parameter, or the start value NAME(0), between two bounds; with :log its logarithm is varied",
        required=True,
    )
    options.add_repeated(
        parser,
        "--column",
        "COLUMN=QUANTITY",
        "the quantity of the model in a column with another name; other columns are then ignored",
    )
    parser.add_argument(
        "--time-unit",
        metavar="UNIT",
        help="unit of the column t, such as ms; the times are converted to seconds",
    )
    options.add_repeated(
        parser,
        "--noise",
        "QUANTITY=SIZE",
        "standard deviation of a quantity (default: estimated from the residuals)",
    )
    parser.add_argument(
        "--loss", choices=("linear", "soft_l1", "huber", "cauchy"), default="linear",
        help="loss function; all except linear reduce the weight of outliers (default: linear)",
    )  # fmt: skip
    options.add(parser, "--starts", "N", "number of first guesses (default: 1)", values.count, default=1)
    options.add_integrator(parser)
    options.add_rtol(parser, "1e-9")
    options.add_plot(parser, "data, fitted runs and residuals")
    options.add_json(parser, "the result")
    parser.set_defaults(execute=execute, lighter="fewer --starts or a looser --rtol")


def execute(args: argparse.Namespace, session: Session) -> int:
    """Fit and print the result; the exit code is 1 if the method did not converge."""
    options.check_plot(args)
    model = values.changed_model(args)
    quantities = dict(args.column) or None
    records = [hybridsim.Record(path, quantities, time_unit=args.time_unit) for path in args.data]
    more = {} if args.rtol is None else {"rtol": args.rtol}
    with Progress(session) as progress:
        found = hybridsim.fit(
            model,
            records,
            dict(_unknown(name, text) for name, text in args.unknown),
            noise={name: _number(text, f"--noise {name}") for name, text in args.noise} or None,
            loss=args.loss,
            starts=args.starts,
            progress=progress.of_steps,
            integrator=args.integrator,
            **more,
        )
    try:  # write files first: printing fails if the reader of the pipe has gone
        if args.plot:
            from hybridsim.plot import save

            save(found.plot(), args.plot)
            session.wrote(args.plot)
    finally:
        if args.json:
            print_json(found.to_dict())
        else:
            say(repr(found))
    if not found.success:
        complain(found.message)
        return SimulationError.exit_code
    return 0


def _unknown(name: str, text: str) -> tuple[str, hybridsim.Unknown]:
    parts = text.split(":")
    is_log = len(parts) == 3 and parts[2] == "log"
    if len(parts) != 2 and not is_log:
        raise UsageError(
            f"--unknown {name}={text}: the bounds are not LOW:HIGH", remedy=f"write --unknown {name}=0.1:0.6"
        )
    low, high = (_number(part, f"--unknown {name}") for part in parts[:2])
    return name, hybridsim.Unknown(low, high, log=is_log)


def _number(text: str, option: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"{option}: {text!r} is not a number", remedy="use a decimal number") from None
