"""`hybridsim sweep MODEL NAME=VALUES ...`: measure a model at many parameter values."""

from __future__ import annotations

import argparse
import multiprocessing
import signal
from concurrent.futures import ProcessPoolExecutor
from contextlib import AbstractContextManager, nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import hybridsim
from hybridsim.cli import options, values
from hybridsim.cli.output import complain, require_folder, say
from hybridsim.cli.progress import Progress
from hybridsim.cli.session import Session
from hybridsim.cli.swept_values import values_by_name
from hybridsim.errors import HybridsimError, SimulationError, UsageError
from hybridsim.files import held

if TYPE_CHECKING:
    from hybridsim.analysis import Sweep
    from hybridsim.model import Model

_EXAMPLES = """\
values: FROM:TO:COUNT (equal steps, ends included), FROM:TO:COUNT:log (equal ratios), or A,B,C. Each number may be an
expression of parameters. In a list A,B,C the expressions are evaluated at every point.

examples:
  hybridsim sweep dfcs F0=20:40:11 omega=400:900:26 --measure amplitude.x,stick_fraction.f
  hybridsim sweep dfcs 'omega=0.2*sqrt(k/m):1.5*sqrt(k/m):66' N=20,30,40 --over omega
  hybridsim sweep dfcs F0=20:60:101 'omega=0.05*sqrt(k/m):2*sqrt(k/m):101' --measure amplitude.x --after 100
  hybridsim sweep belt v_belt=0.05:0.2:16 --measure final --t-end 50
  hybridsim sweep dfcs F0=20:40:11 --measure 'maximum.x,first_passage.x>2e-4' --t-end 0.1
"""
_NEEDS_T_END = ("final", "first_passage", "stops")  # measures that need --t-end
_MOST_DRAWN = 2  # largest number of swept parameters in a picture


def add_to(commands: Any) -> None:
    """Add the command `sweep` to the parser."""
    parser = commands.add_parser(
        "sweep",
        help="measure a model at many parameter values",
        description="Measure the steady state, or the end of a run, at many parameter values. If one point fails, its "
        "status is recorded and the other points still run.",
        epilog=_EXAMPLES
        + "\nThe folder receives sweep.csv, sweep.json and sweep.png. Finished points are recorded in sweep.journal: "
        "after Ctrl-C or a crash the same command continues from there.",
    )
    options.add_model_arguments(parser)
    parser.add_argument(
        "axes",
        metavar="NAME=VALUES",
        nargs="+",
        type=values.assignment,
        help="a parameter or state with its values; for a state, these are initial values",
    )
    options.add(
        parser,
        "--measure",
        "A,B",
        "quantities of the steady state: steady (default) for the usual ones, or amplitude.x, energy.x, "
        "harmonic.x.1, stick_fraction.f, period, kind, ...; with --t-end, quantities of a run: final.x, maximum.x, "
        "rms.x, stops.f, 'first_passage.x>0.1', ..., or final for all states",
        values.names,
        default=("steady",),
    )
    parser.add_argument(
        "--list",
        action="store_true",
        help="combine the k-th values of all parameters, instead of all combinations",
    )
    options.add(parser, "--t-end", "TIME", "end time of each run, for measures of a whole run")
    options.add(
        parser,
        "--after",
        "PERIODS",
        "measure one period after this number of forcing periods, even if the motion is not yet periodic; "
        "useful for maps of many points",
        values.count,
    )
    parser.add_argument(
        "--warm-start",
        action="store_true",
        help="start each run from the result of the previous point on the first axis",
    )
    options.add_integrator(parser)
    options.add_rtol(parser, "depends on the measure")
    options.add_workers(parser)
    options.add(
        parser,
        "--processes",
        "N",
        "use this number of processes instead of threads, for integrators that step in Python (scipy-*, cvode-*)",
        values.workers,
    )
    options.add(parser, "--over", "NAME", "plot lines over this parameter instead of a map")
    options.add_out(parser, "sweep-MODEL")
    options.add_json(parser, "the data")
    parser.set_defaults(execute=execute, lighter="fewer values at a time, fewer --workers or a looser --rtol")


def execute(args: argparse.Namespace, session: Session) -> int:
    """Run the sweep, print a table and write the results; the exit code is 1 if all points failed or some were lost."""
    model = values.changed_model(args)
    folder: Path = args.out or Path(f"sweep-{model.name}")
    require_folder(folder, "--out")
    axes = values_by_name(model, args.axes)
    if args.over is not None and args.over not in axes:
        raise UsageError(
            f"--over: the sweep does not vary '{args.over}'", remedy=f"swept parameters: {', '.join(axes)}"
        )
    if len(axes) > _MOST_DRAWN and not args.list:
        complain("no picture is drawn, because more than two parameters are swept")
    settings: dict[str, Any] = {
        name: getattr(args, name) for name in ("integrator", "rtol") if getattr(args, name) is not None
    }
    is_run = any(word.partition(".")[0] in _NEEDS_T_END for word in args.measure)
    if is_run or (args.t_end is not None and tuple(args.measure) != ("steady",)):
        settings["t_span"] = (0.0, _end_of_all(model, args.t_end, axes))
        if args.after is not None:
            raise UsageError(
                "--after cannot be combined with measures of a whole run",
                remedy="remove --after, or choose measures of one period",
            )
    elif args.t_end is not None:
        raise UsageError(
            "--t-end requires a measure of a whole run", remedy="remove --t-end or add --measure final"
        )

    if args.after is not None:
        settings["after"] = args.after
    if args.processes is not None and args.workers is not None:
        raise UsageError(
            "--processes cannot be combined with --workers",
            remedy="remove --workers, which sets the number of threads",
        )

    is_new = not folder.exists()
    folder.mkdir(parents=True, exist_ok=True)
    with held(folder, f"Another sweep is writing to {folder}"):
        return _fill(args, session, model, axes, settings, folder, is_new)


def _fill(
    args: argparse.Namespace,
    session: Session,
    model: Model,
    axes: dict[str, list[Any]],
    settings: dict[str, Any],
    folder: Path,
    is_new: bool,
) -> int:
    """Run the sweep and write its results to a folder, which is locked for other processes."""
    from hybridsim.analysis.sweep.work.job import LOST

    journal = folder / "sweep.journal"
    if journal.exists():
        complain(f"continuing from {journal}")
    try:
        with Progress(session) as progress, session.stopping_gently(), _pool(args.processes) as executor:
            result = hybridsim.sweep(
                model,
                axes,
                args.measure,
                mode="list" if args.list else "grid",
                executor=executor,
                workers=args.workers,
                warm_start=args.warm_start,
                journal=journal,
                progress=progress.of_steps,
                **settings,
            )
    except UsageError:
        if is_new and not any(folder.iterdir()):
            folder.rmdir()
        raise
    is_lost = any(text.startswith(LOST) for text, _ in result.problems())
    try:  # write files first: printing fails if the reader of the pipe has gone
        _write(result, args.over, folder, session)
        if not (result.interrupted or is_lost):
            journal.unlink(missing_ok=True)
    finally:
        say(result.to_json() if args.json else result.table())
    for error, count in result.problems():
        complain(f"{count} of {result.status.size} points failed: {error}")
    if result.interrupted:
        complain(f"interrupted after {int((~result.failed).sum())} of {result.status.size} points")
        return session.interrupted_code
    if is_lost:
        complain(
            "a worker process ended unexpectedly, for example because memory was exhausted; run the same command "
            "again to compute the missing points"
        )
    return SimulationError.exit_code if is_lost or result.failed.all() else 0


def _pool(processes: int | None) -> AbstractContextManager[ProcessPoolExecutor | None]:
    """Return a pool of processes that leave Ctrl-C to this process, or None for threads."""
    if processes is None:
        return nullcontext()
    return ProcessPoolExecutor(
        processes,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=signal.signal,
        initargs=(signal.SIGINT, signal.SIG_IGN),
    )


def _write(result: Sweep, over: str | None, folder: Path, session: Session) -> None:
    result.to_csv(folder / "sweep.csv")
    session.wrote(folder / "sweep.csv")
    result.to_json(folder / "sweep.json")
    session.wrote(folder / "sweep.json")
    if len(result.dimensions) > _MOST_DRAWN or not any(v.dtype.kind in "fc" for v in result.values.values()):
        return
    from hybridsim.plot import save, sweep
    from hybridsim.plot.sweeps.picture import is_map
    from hybridsim.plot.sweeps.readings import not_drawn

    save(sweep(result, over=over), folder / "sweep.png")
    session.wrote(folder / "sweep.png")
    if left := not_drawn(result, arrays=not is_map(result, over)):
        complain(
            f"Results in the tables but not in the picture: {', '.join(left)}. Choose quantities with --measure."
        )


def _end_of_all(model: Model, text: str | None, axes: dict[str, list[Any]]) -> float:
    """Return the common end time of all runs; reject an end time that depends on a swept parameter."""
    end = values.end_time(model, text)
    for name, row in axes.items():
        ends = {end}
        for value in row:
            with suppress(HybridsimError):  # an invalid value is reported at its own points
                ends.add(values.end_time(model.with_(**{name: value}), text))
        if len(ends) > 1:
            end_time = "the end of the runs" if text is None else f"--t-end {text}"
            raise UsageError(
                f"{end_time} depends on the swept parameter {name}, but all runs must end at the same time",
                remedy="set --t-end to a number",
            )
    return end
