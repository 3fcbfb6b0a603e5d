"""`hybridsim sweep MODEL NAME=VALUES ...`: a measure over values of parameters, as data and as a picture."""

from __future__ import annotations

import argparse
import math
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hybridsim.cli import options, values
from hybridsim.cli.output import complain, require_folder, say
from hybridsim.cli.progress import Progress
from hybridsim.cli.session import Session
from hybridsim.errors import HybridsimError, Place, SimulationError, UsageError
from hybridsim.files import held

if TYPE_CHECKING:
    from hybridsim.analysis import Sweep
    from hybridsim.model import Model

_EXAMPLES = """\
values: FROM:TO:COUNT, equal steps with both ends; FROM:TO:COUNT:log, equal ratios; or A,B,C. Each may be an expression
of parameters; in a row A,B,C it is evaluated at every point.

examples:
  hybridsim sweep dfcs F0=20:40:11 omega=400:900:26 --measure amplitude.x,stick_fraction.f
  hybridsim sweep dfcs 'omega=0.2*sqrt(k/m):1.5*sqrt(k/m):66' N=20,30,40 --over omega
  hybridsim sweep dfcs F0=20:60:101 'omega=0.05*sqrt(k/m):2*sqrt(k/m):101' --measure amplitude.x --after 100
  hybridsim sweep belt v_belt=0.05:0.2:16 --measure final --t-end 50
"""
_MOST_DRAWN = 2  # parameters of a picture


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "sweep",
        help="measure a model at many values of its parameters",
        description="Measure a model at many values of its parameters: the steady state, or the end of a run. A point "
        "that fails leaves its status, and all the others.",
        epilog=_EXAMPLES
        + "\nThe folder gets sweep.csv, sweep.json and sweep.png. Until then sweep.journal has what is done: the same "
        "command goes on from there, after Ctrl-C or worse.",
    )
    values.add_model_arguments(parser)
    parser.add_argument(
        "axes",
        metavar="NAME=VALUES",
        nargs="+",
        type=values.assignment,
        help="a parameter, or a state with its initial value, and what it is set to",
    )
    parser.add_argument(
        "--measure",
        metavar="A,B",
        type=values.names,
        default=("steady",),
        help="readings of the steady state: steady (the default) for the usual ones, or amplitude.x, energy.x, "
        "harmonic.x.1, stick_fraction.f, period, kind, ...; final or final.x: states at --t-end",
    )
    parser.add_argument(
        "--list", action="store_true", help="take the k-th values of all together, not all combinations"
    )
    parser.add_argument("--t-end", metavar="TIME", help="end of each run, for --measure final (as in run)")
    parser.add_argument(
        "--after",
        metavar="PERIODS",
        type=values.count,
        help="readings of the period that ends so many periods of the forcing after the start, whether or not the "
        "motion repeats by then: for maps of many points",
    )
    parser.add_argument(
        "--warm-start", action="store_true", help="start from the neighbour on the first axis"
    )
    options.add_integrator(parser)
    options.add_rtol(parser, "that of the measure")
    options.add_workers(parser)
    parser.add_argument("--over", metavar="NAME", help="draw lines over this parameter instead of maps")
    options.add_out(parser, "sweep-MODEL")
    options.add_json(parser, "the data")
    parser.set_defaults(execute=execute, lighter="fewer values at a time, fewer --workers or a looser --rtol")


def execute(args: argparse.Namespace, session: Session) -> int:
    """Sweep, print the table and fill the folder; 1 where no point has a result."""
    model = values.changed_model(args)
    folder: Path = args.out or Path(f"sweep-{model.name}")
    require_folder(folder, "--out")
    axes = values_by_name(model, args.axes)
    if args.over is not None and args.over not in axes:
        raise UsageError(f"--over {args.over}", remedy=f"name one of the parameters: {', '.join(axes)}")
    if len(axes) > _MOST_DRAWN and not args.list:
        complain("more than two parameters: there will be no picture")
    given: dict[str, Any] = {
        name: getattr(args, name) for name in ("integrator", "rtol") if getattr(args, name) is not None
    }
    if any(word.partition(".")[0] == "final" for word in args.measure):
        given["t_span"] = (0.0, _end_of_all(model, args.t_end, axes))
        if args.after is not None:
            raise UsageError(
                "--after is for readings of a period", remedy="leave it out beside --measure final"
            )
    elif args.t_end is not None:
        raise UsageError("--t-end is for --measure final", remedy="leave it out: steady states have no end")

    if args.after is not None:
        given["after"] = args.after

    is_new = not folder.exists()
    folder.mkdir(parents=True, exist_ok=True)
    with held(folder, f"another sweep is writing to {folder}"):
        return _fill(args, session, model, axes, given, folder, is_new)


def _fill(
    args: argparse.Namespace,
    session: Session,
    model: Model,
    axes: dict[str, list[Any]],
    given: dict[str, Any],
    folder: Path,
    is_new: bool,
) -> int:
    """Sweep, and write what comes of it into a folder that no other sweep writes to."""
    import hybridsim

    journal = folder / "sweep.journal"
    if journal.exists():
        complain(f"going on with {journal}")
    try:
        with Progress(session) as progress, session.stopping_gently():
            result = hybridsim.sweep(
                model,
                axes,
                args.measure,
                mode="list" if args.list else "grid",
                workers=args.workers,
                warm_start=args.warm_start,
                journal=journal,
                progress=progress.of_steps,
                **given,
            )
    except UsageError:
        if is_new and not any(folder.iterdir()):
            folder.rmdir()
        raise
    try:  # before anything is printed to a reader who may have gone
        _write(result, args.over, folder, session)
        if not result.interrupted:
            journal.unlink(missing_ok=True)
    finally:
        say(result.to_json() if args.json else result.table())
    for text, count in result.problems():
        complain(f"{count} of {result.status.size} points: {text}")
    if result.interrupted:
        complain(f"interrupted after {int((~result.failed).sum())} of {result.status.size} points")
        return session.interrupted_code
    return SimulationError.exit_code if result.failed.all() else 0


def _write(result: Sweep, over: str | None, folder: Path, session: Session) -> None:
    result.to_csv(folder / "sweep.csv")
    session.wrote(folder / "sweep.csv")
    result.to_json(folder / "sweep.json")
    session.wrote(folder / "sweep.json")
    if len(result.dimensions) > _MOST_DRAWN or not any(v.dtype.kind in "fc" for v in result.values.values()):
        return
    from hybridsim.plot import save, sweep
    from hybridsim.plot.sweep_picture import is_map
    from hybridsim.plot.sweep_readings import not_drawn

    save(sweep(result, over=over), folder / "sweep.png")
    session.wrote(folder / "sweep.png")
    if left := not_drawn(result, arrays=not is_map(result, over)):
        complain(f"not drawn, but in the tables: {', '.join(left)} (--measure chooses)")


def _end_of_all(model: Model, text: str | None, axes: dict[str, list[Any]]) -> float:
    """The end of all runs, which is refused where it depends on what is swept."""
    end = values.end_time(model, text)
    for name, row in axes.items():
        ends = {end}
        for value in row:
            with suppress(HybridsimError):  # a value that no model takes fails at its own points
                ends.add(values.end_time(model.with_(**{name: value}), text))
        if len(ends) > 1:
            what = "the end of the runs" if text is None else f"--t-end {text}"
            raise UsageError(
                f"{what} depends on {name}, which is swept, and all runs end at one time",
                remedy="give --t-end as a number",
            )
    return end


def values_by_name(model: Model, pairs: list[tuple[str, str]]) -> dict[str, list[Any]]:
    """Values of parameters as they are written on a command line, FROM:TO:COUNT or A,B,C, by name."""
    axes: dict[str, list[Any]] = {}
    for name, text in pairs:
        if name in axes:
            raise UsageError(f"{name} is given twice", remedy="give all its values at once")
        with values.blaming_the_command_line():
            axes[name] = _row(model, name, text)
    return axes


def _row(model: Model, name: str, text: str) -> list[Any]:
    """Values of one parameter: a row of expressions, or equal steps."""
    if ":" not in text:
        from hybridsim.expr import parse

        return [parse(part, Place(file=name, text=part)) for part in _parts(text)]
    parts = [part.strip() for part in text.split(":")]
    is_log = len(parts) == 4 and parts[3] == "log"
    if not (len(parts) == 3 or is_log) or not parts[2].isdecimal() or not parts[2].strip("0"):
        raise UsageError(
            f"{name}={text}", remedy="write FROM:TO:COUNT, FROM:TO:COUNT:log, or values with commas between"
        )
    from hybridsim.analysis.sweep.axes import MOST_POINTS

    if len(parts[2]) > len(str(MOST_POINTS)) or int(parts[2]) > MOST_POINTS:
        raise UsageError(f"{name}={text}", remedy=f"a sweep has {MOST_POINTS} points at most; sweep in parts")
    low, high, count = number_of(model, name, parts[0]), number_of(model, name, parts[1]), int(parts[2])
    if is_log and not (low > 0 and high > 0):
        raise UsageError(f"{name}={text}", remedy="equal ratios go between two numbers above zero")
    between = [k / (count - 1) for k in range(1, count - 1)]
    if is_log:
        inner = [math.exp((1 - part) * math.log(low) + part * math.log(high)) for part in between]
    else:
        inner = [low + (high - low) * part for part in between]
    return [low, *inner, high][:count]


def _parts(text: str) -> list[str]:
    """What is between the commas that stand in no brackets."""
    parts, depth = [""], 0
    for character in text:
        depth += {"(": 1, ")": -1}.get(character, 0)
        if character == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += character
    return [part.strip() for part in parts]


def number_of(model: Model, name: str, text: str) -> float:
    """A number that is written as an expression of the model's parameters."""
    from hybridsim.expr import evaluate, parse, require_names

    known = model.parameter_values()
    expression = parse(text, Place(file=name, text=text))
    require_names(expression, known)
    return float(evaluate(expression, known))
