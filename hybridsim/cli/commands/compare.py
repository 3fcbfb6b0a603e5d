"""`hybridsim compare`: compare error and run time of integrators on one model, or on a suite of test cases."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

import hybridsim
from hybridsim.cli import options, values
from hybridsim.cli.output import require_folder, say
from hybridsim.cli.progress import Progress
from hybridsim.cli.session import Session
from hybridsim.errors import UsageError
from hybridsim.files import fields_of

if TYPE_CHECKING:
    from hybridsim.analysis import Comparison, SuiteComparison

_SUITE_FOLDER = Path("compare-suite")


def add_to(commands: Any) -> None:
    """Add the command `compare` to the parser."""
    parser = commands.add_parser(
        "compare",
        help="compare error and run time of integrators on a model or on a suite",
        description="Compare error and run time of integrators on one model, or on a suite of benchmark problems "
        "(scenes). Print a table and write a chart and the data.",
        epilog="The folder receives chart.png (or suite.png), table.csv and comparison.json.",
    )
    options.add_model_arguments(parser, optional=True)
    options.add_span_argument(parser, values.COMPARED_PERIODS)
    parser.add_argument(
        "--suite", action="store_true", help="run the scenes of the suite instead of one model"
    )
    options.add(parser, "--scenes", "A,B", "scenes of the suite to run (default: all)", values.names)
    options.add(
        parser,
        "--integrators",
        "A,B",
        "integrators to compare (default: all that support the model)",
        values.names,
    )
    options.add(
        parser, "--rtol", "TOL,TOL", "relative tolerances of the adaptive integrators", values.positives
    )
    options.add(parser, "--steps", "N,N", "steps per period of the fixed-step integrators", values.counts)
    options.add(
        parser,
        "--regularized",
        "KIND,KIND",
        "also compare these regularised friction laws (tanh, arctan, karnopp)",
        values.names,
    )
    options.add(
        parser,
        "--v0",
        "V,V",
        "velocity widths of the regularised laws (default: 1e-1 to 1e-4 of the nominal velocity)",
        values.positives,
    )
    options.add(
        parser, "--repeat", "N", "timed repetitions of every run (default: 3)", values.count, default=3
    )
    options.add_budget(parser, "120; 600 with --suite")
    options.add_out(parser, "compare-MODEL")
    options.add_json(parser, "the data")
    parser.set_defaults(
        execute=execute, lighter="a shorter --t-end or looser --rtol, and with --suite fewer --scenes"
    )


def execute(args: argparse.Namespace, session: Session) -> int:
    """Compare the integrators, print the table and write the results."""
    folder: Path | None = args.out
    if folder is not None:
        require_folder(folder, "--out")
    if args.suite:
        return _suite(args, folder or _SUITE_FOLDER, session)
    if args.model is None:
        raise UsageError(
            "compare needs a model or --suite", remedy="add a model (see: hybridsim models) or --suite"
        )
    if args.scenes:
        raise UsageError("--scenes requires --suite", remedy="add --suite or remove --scenes")
    return _model(args, folder, session)


def _model(args: argparse.Namespace, folder: Path | None, session: Session) -> int:
    model = values.changed_model(args)
    span = (0.0, values.end_time(model, args.t_end, values.COMPARED_PERIODS))
    folder = folder or Path(f"compare-{model.name}")
    require_folder(folder, "--out")

    with Progress(session) as progress:
        comparison = hybridsim.compare(
            model,
            t_span=span,
            regularized=args.regularized,
            v0=args.v0,
            progress=progress.of_steps,
            **_settings(args),
        )
    from hybridsim.plot import regularisation, work_precision

    draw = regularisation if args.regularized else work_precision
    _write(comparison, args.json, folder, "chart.png", draw, session)
    return 0


def _suite(args: argparse.Namespace, folder: Path, session: Session) -> int:
    of_one_model = {"MODEL": args.model, "-p": args.param, "--x0": args.x0, "--t-end": args.t_end}
    of_one_model |= {"--regularized": args.regularized, "--v0": args.v0}
    for option, value in of_one_model.items():
        if value:
            raise UsageError(
                f"{option} cannot be combined with --suite, which has its own models",
                remedy=f"remove {option} or --suite",
            )
    require_folder(folder, "--out")

    with Progress(session) as progress:
        suite = hybridsim.compare_suite(scenes=args.scenes, progress=progress.of_steps, **_settings(args))
    from hybridsim.plot import suite_page

    _write(suite, args.json, folder, "suite.png", suite_page, session)
    return 0


def _settings(args: argparse.Namespace) -> dict[str, Any]:
    """Return the arguments that are common to comparisons of one model and of the suite."""
    budget = {} if args.budget is None else {"budget": args.budget}
    return {"rtols": args.rtol, **fields_of(args, "integrators", "steps", "repeat"), **budget}


def _write(
    result: Comparison | SuiteComparison,
    as_json: bool,
    folder: Path,
    picture: str,
    draw: Any,
    session: Session,
) -> None:
    """Write the files, then print the result, because printing may fail if the output is a closed pipe."""
    from hybridsim.plot import save

    try:
        folder.mkdir(parents=True, exist_ok=True)
        result.to_csv(folder / "table.csv")
        session.wrote(folder / "table.csv")
        result.to_json(folder / "comparison.json")
        session.wrote(folder / "comparison.json")
        save(draw(result), folder / picture)
        session.wrote(folder / picture)
    finally:
        say(result.to_json() if as_json else result.table())
