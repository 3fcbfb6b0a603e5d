"""This module prints the solution of a command, writes its files and returns the exit code."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Container, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hybridsim import __version__
from hybridsim.cli import options, values
from hybridsim.cli.output import complain, print_json, require_apart, require_writable, say
from hybridsim.cli.progress import Progress
from hybridsim.cli.session import Session
from hybridsim.errors import RunInterrupted, SimulationError, UsageError
from hybridsim.files import fields_of
from hybridsim.presentation.readable import cost_text

if TYPE_CHECKING:
    from hybridsim.model.parts.model import Model
    from hybridsim.solution import Solution
    from hybridsim.solution.explain.explanation import Explanation


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options for output files of a run."""
    options.add_plot(parser, "the run")
    options.add(
        parser,
        "--animate",
        "FILE",
        "animate the drawing of the model in a .gif, .html or .mp4 file (.mp4 needs ffmpeg)",
        Path,
    )
    options.add(parser, "--csv", "FILE", "write the time series as a CSV table", Path)
    options.add(parser, "--npz", "FILE", "write the time series and the events for numpy.load", Path)
    options.add(
        parser,
        "--points",
        "N",
        "number of equally spaced times in --csv and --npz (default: all steps, and both sides of events)",
        values.count,
    )
    options.add(
        parser,
        "--save",
        "FILE",
        "write the whole solution (.hsol) for hybridsim resume and hs.load_solution",
        Path,
    )
    options.add_repeated(
        parser,
        "--explain",
        "N",
        "explain event number N, counted from 0; repeat the option for more events",
        int,
    )
    options.add_json(parser, "the result", "the summary")


def check_arguments(args: argparse.Namespace) -> None:
    """Before the run starts, reject output files that cannot be written."""
    options.check_plot(args)
    if args.animate:
        require_writable(args.animate, "--animate", options.ANIMATIONS)
    if args.csv:
        require_writable(args.csv, "--csv")
    if args.npz:
        require_writable(args.npz, "--npz", (".npz",))
    if args.save:
        if str(args.save) in ("all", "events", "last-period", "nothing"):
            raise UsageError(
                f"--save needs a file name, not '{args.save}'",
                remedy=f"use --save run.hsol to write the solution, or --keep {args.save} to choose the "
                "stored results",
            )
        require_writable(args.save, "--save", (".hsol",))
    others = {"the file of the model": Path(args.model)} if Path(getattr(args, "model", "")).is_file() else {}
    for option in ("plot", "animate", "csv", "npz", "save"):
        path = getattr(args, option)
        if path:
            require_apart(path, f"--{option}", others)
            others |= {f"the output file of --{option}": path}
    if args.points is not None and not (args.csv or args.npz):
        raise UsageError("--points needs --csv or --npz", remedy="add --csv FILE or --npz FILE")
    if args.points == 1:
        raise UsageError("--points cannot be 1", remedy="use at least 2 (the start and the end)")
    if args.points is not None:
        from hybridsim.solution.files.tabulated import MOST_POINTS

        if args.points > MOST_POINTS:
            raise UsageError(f"--points cannot be {args.points}", remedy=f"use at most {MOST_POINTS}")


def check_drawing(model: Model, args: argparse.Namespace) -> None:
    """Before the run starts, reject an animation that cannot be made."""
    if args.animate:
        from hybridsim.plot.drawing.animation import check_animation

        check_animation(model, args.animate)


def limits(args: argparse.Namespace) -> dict[str, Any]:
    """Return the limits of a run from the command line, by name."""
    return {name: values.option_value(text) for name, text in args.limit}


def as_far_as_it_came(run: Callable[[], Solution]) -> Solution:
    """Run a simulation and return its solution; after Ctrl-C, return the part computed so far."""
    try:
        return run()
    except RunInterrupted as stopped:
        found: Solution = stopped.solution
        return found


def deliver(
    solution: Solution, args: argparse.Namespace, session: Session, already_reported: Container[str] = ()
) -> int:
    """Write the files, print the summary and return the exit code."""
    explanations, unexplained = _explanations(solution, args.explain)
    try:  # write files first: printing fails if the reader of the pipe, such as `head`, has gone
        if solution.t.size:  # a run that stopped before its first step has nothing to write
            _write(solution, args, session)
        if args.save:
            solution.save(args.save)
            session.wrote(args.save)
    finally:
        if args.json:
            more = {"explanations": [asdict(e) for e in explanations]} if explanations else {}
            print_json(record(solution) | more)
        else:
            say("\n".join([*summary(solution), *map(str, explanations)]))
    code = exit_code(solution, args.save, session, already_reported)
    if unexplained is not None:
        raise unexplained
    return code


def exit_code(
    solution: Solution, saved: Path | None, session: Session, already_reported: Container[str] = ()
) -> int:
    """Print the warnings of a run and the reason if it stopped early, and return the exit code."""
    for warning in (one for one in solution.warnings if one not in already_reported):
        complain(f"warning: {warning}")
    if solution.success:
        return 0
    begins = solution.message.startswith(solution.status)
    reason = solution.message if begins else f"{solution.status}: {solution.message}"
    if solution.status in ("limit", "interrupted"):
        reason = reason.removesuffix(", and sol.resume() continues the run").removesuffix(
            "; the results so far are kept"
        )
        resume = f"'hybridsim resume {saved}' continues the run"
        reason += f"; {resume if saved else 'with --save FILE.hsol, hybridsim resume can continue the run'}"
    complain(reason)
    return session.interrupted_code if solution.status == "interrupted" else SimulationError.exit_code


def _explanations(solution: Solution, numbers: Sequence[int]) -> tuple[list[Explanation], UsageError | None]:
    """Return the explanations of events as text, and the first error, which is raised after the output."""
    found, fault = [], None
    for number in numbers:
        try:
            found.append(solution.explain(number))
        except UsageError as error:
            fault = fault or error
    return found, fault


def _write(solution: Solution, args: argparse.Namespace, session: Session) -> None:
    if args.csv:
        solution.to_csv(args.csv, args.points)
        session.wrote(args.csv)
    if args.npz:
        solution.to_npz(args.npz, args.points)
        session.wrote(args.npz)
    if solution.t_end == solution.t_start:
        if args.plot or args.animate:
            complain("no picture was written, because the run has zero length")
        return
    if args.plot:
        from hybridsim.plot import save, time_history

        save(time_history(solution), args.plot)
        session.wrote(args.plot)
    if args.animate:
        with Progress(session) as progress:
            solution.animate(args.animate, progress=progress)
        session.wrote(args.animate)


def _has_events(solution: Solution) -> bool:
    """Return whether `save` keeps the events and modes of the run."""
    return solution._run.save != "nothing"


def _shares(solution: Solution) -> dict[str, dict[str, float]]:
    """Return the fraction of time that each component spent in each mode."""
    shares: dict[str, dict[str, float]] = {}
    for component, intervals in solution.modes.items():
        spent: dict[str, float] = {}
        for interval in intervals:
            spent[interval.mode] = spent.get(interval.mode, 0.0) + abs(interval.t1 - interval.t0)
        total = math.fsum(spent.values()) or 1.0
        shares[component] = {mode: time / total for mode, time in spent.items()}
    return shares


def _final(solution: Solution) -> list[tuple[str, float]]:
    """Return the name and value of each state at the end of the run, or nothing if no run was started.

    Those of discrete states follow, where something of the run is kept.
    """
    found = [(name, row[-1]) for name, row in zip(solution.names, solution.y, strict=True) if row.size]
    if not solution.t.size or solution._run.save in ("nothing", "events"):
        return found
    return found + [(d.name, float(solution.output(d.name, solution.t_end))) for d in solution.model.discrete]


def summary(solution: Solution) -> list[str]:
    """Return the lines of the summary of a run."""
    from hybridsim.solution.event import counted_kind

    model = solution.model
    has_events = _has_events(solution)
    found = (
        {kind: n for kind, n in solution._of_model.kinds().items() if kind != "corner"} if has_events else {}
    )
    counted = ", ".join(counted_kind(kind, n) for kind, n in found.items())
    lines = [
        f"{model.name}: {model.title}" if model.title else model.name,
        f"  integrator   {solution.integrator}"
        + (f", chosen because {solution.chosen_because}" if solution.chosen_because else ""),
        f"  status       {solution.status}",
        f"  events       {sum(found.values())}{f' ({counted})' if counted else ''}"
        if has_events
        else "  events       not stored",
    ]
    for impact in model.impacts if has_events else ():
        hits = sum(e.component == impact.name and e.guard == "gap" for e in solution.events)
        lines.append(f"  {f'impacts ({impact.name})':<12} {hits}")
    for component, modes in (_shares(solution) if has_events else {}).items():
        shares = ", ".join(f"{mode} {100 * share:.3g} %" for mode, share in modes.items())
        lines.append(f"  {f'modes ({component})':<12} {shares} of the time")
    if solution.t.size:
        from hybridsim.model.checks.units import label_of

        units = {state.name: label_of(state.unit) for state in model.states}
        final = ", ".join(
            f"{name} = {value:.9g} {units.get(name, '')}".rstrip() for name, value in _final(solution)
        )
        lines.append(f"  time         {solution.t_start:g} to {solution.t_end:.9g}")
        lines.append(f"  final state  {final}")
    lines.append(f"  cost         {cost_text(solution.stats)}")
    return lines


def record(solution: Solution) -> dict[str, Any]:
    """Return the result of a run for JSON."""
    model, has_events = solution.model, _has_events(solution)
    return {
        "hybridsim": __version__,
        "model": model.name,
        "parameters": model.parameter_values(),
        "integrator": solution.integrator,
        "success": solution.success,
        "status": solution.status,
        "message": solution.message,
        "warnings": solution.warnings,
        "t_span": [solution.t_start, solution.t_end] if solution.t.size else None,
        "final": dict(_final(solution)),
        "kept": solution._run.save,
        "modes": _shares(solution) if has_events else None,
        "events": None
        if not has_events
        else [
            fields_of(event, "t", "kind", "component", "guard", "source", "target", "x_minus", "x_plus")
            for event in solution.events
        ],
        "stats": solution.stats,
    }
