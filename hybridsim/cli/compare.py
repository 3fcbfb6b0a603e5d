"""`hybridsim compare MODEL`: which integrator buys accuracy cheapest on it: a table, a chart and the data."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hybridsim.cli import values
from hybridsim.cli.output import require_folder
from hybridsim.cli.progress import Progress
from hybridsim.cli.session import Session

if TYPE_CHECKING:
    from hybridsim.analysis import Comparison


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "compare",
        help="compare integrators on a model: error against cost",
        description="Compare integrators on a model, error against cost: a table, a chart and the data.",
        epilog="The folder gets chart.png, table.csv and comparison.json.",
    )
    values.add_model_arguments(parser)
    values.add_span_argument(parser, values.COMPARED_PERIODS)
    parser.add_argument(
        "--integrators", metavar="A,B", type=values.names, help="compare these only (default: all that can)"
    )
    parser.add_argument(
        "--rtol",
        metavar="TOL,TOL",
        type=values.positives,
        help="relative tolerances of the adaptive integrators",
    )
    parser.add_argument(
        "--steps", metavar="N,N", type=values.counts, help="steps a period of the fixed-step integrators"
    )
    parser.add_argument(
        "--repeat",
        metavar="N",
        type=values.count,
        default=3,
        help="timed repetitions of every run (default: 3)",
    )
    parser.add_argument(
        "--out", metavar="FOLDER", type=Path, help="folder of the results (default: compare-MODEL, here)"
    )
    parser.add_argument("--json", action="store_true", help="print the data as JSON instead of the table")
    parser.set_defaults(execute=execute)


def execute(args: argparse.Namespace, session: Session) -> int:
    """Compare, print the table and fill the folder."""
    folder: Path | None = args.out
    if folder is not None:
        require_folder(folder, "--out")
    model = values.changed_model(args)
    span = (0.0, values.end_time(model, args.t_end, values.COMPARED_PERIODS))
    folder = folder or Path(f"compare-{model.name}")
    require_folder(folder, "--out")

    import hybridsim

    with Progress(session) as progress:
        comparison = hybridsim.compare(
            model,
            t_span=span,
            integrators=args.integrators,
            rtols=args.rtol,
            steps=args.steps,
            repeat=args.repeat,
            progress=lambda done, total, what: progress(done / total, what),
        )
    if args.json:
        print(comparison.to_json())
    else:
        print(comparison.table())
    _write(comparison, folder, session)
    return 0


def _write(comparison: Comparison, folder: Path, session: Session) -> None:
    from hybridsim.plot import save, work_precision

    folder.mkdir(parents=True, exist_ok=True)
    comparison.to_csv(folder / "table.csv")
    session.wrote(folder / "table.csv")
    comparison.to_json(folder / "comparison.json")
    session.wrote(folder / "comparison.json")
    save(work_precision(comparison), folder / "chart.png")
    session.wrote(folder / "chart.png")
