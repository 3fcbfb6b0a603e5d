"""`hybridsim run MODEL`: simulate a model, print a summary and write the requested files."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

import hybridsim
from hybridsim.cli import options, outcome, values
from hybridsim.cli.output import complain
from hybridsim.cli.progress import Progress
from hybridsim.cli.session import Session
from hybridsim.errors import UsageError, near, nearest

if TYPE_CHECKING:
    from hybridsim.model.parts.model import Model
    from hybridsim.solution import Solution

LIGHTER = "a shorter --t-end or a looser --rtol, or --limit megabytes=1000 to stop with a partial result"
_EXAMPLES = """\
examples:
  hybridsim run dfcs
  hybridsim run dfcs -p F0=22 -p 'omega=0.64*sqrt(k/m)' --t-end 20T --plot out.png
  hybridsim run my.toml --integrator cvode-bdf --rtol 1e-10 --csv out.csv --json > out.json
  hybridsim run belt --t-end 1e4 --limit events=500 --save belt.hsol
  hybridsim run dfcs --t-end 1e6T --keep last-period --plot out.png
"""


def add_to(commands: Any) -> None:
    """Add the command `run` to the parser."""
    parser = commands.add_parser(
        "run",
        help="simulate a model",
        description="Simulate a model, print a summary, and write the requested files.",
        epilog=_EXAMPLES,
    )
    add_settings(parser)
    options.add(
        parser,
        "--keep",
        "WHAT",
        "parts of the run to store; the run does not change. all (default): everything. events: the "
        "events, but no states between them. last-period, or a number: the last period, or the last units of time. "
        "nothing: only the final state. --plot, --animate, --csv and --npz need all, last-period or a number; "
        "--explain needs all",
    )
    outcome.add_arguments(parser)
    parser.set_defaults(execute=execute, lighter=LIGHTER)


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Add the options for the model, the span, the integrator and the limits of one run."""
    options.add_model_arguments(parser)
    options.add_span_argument(parser)
    options.add_integrator(parser)
    options.add_rtol(parser, "1e-9")
    options.add(
        parser,
        "--atol",
        "TOL",
        "absolute tolerance of every state (default: rtol * 1e-3 * the state's nominal size)",
        values.positive,
    )
    options.add(parser, "--max-step", "TIME", "largest step size", values.positive)
    options.add_repeated(parser, "--option", "NAME=VALUE", "set an option of the integrator itself")
    options.add_limit(parser)


def execute(args: argparse.Namespace, session: Session) -> int:
    """Simulate the model and write the output; the exit code is 1 if the simulation failed."""
    outcome.check_arguments(args)
    settings = run_settings(args)
    if args.keep is not None:
        settings["keep"] = _save_setting(args)
    model = values.changed_model(args)
    outcome.check_drawing(model, args)
    solution, cautions = simulated(model, settings, args, session)
    return outcome.deliver(solution, args, session, already_reported=cautions)


def simulated(
    model: Model, settings: dict[str, Any], args: argparse.Namespace, session: Session
) -> tuple[Solution, list[str]]:
    """Return the solution of a run, even if interrupted, and the warnings that were printed before the run."""
    t_end = values.end_time(model, args.t_end)

    from hybridsim.integrators.registry import UnknownOption, integrator_class, option_names
    from hybridsim.model.checks.doubtful import forces_of, jumps_of
    from hybridsim.model.units.faults import unit_faults

    cautions = [caution.sentence for caution in (*jumps_of(model), *forces_of(model), *unit_faults(model))]
    for caution in cautions:  # before the run, which may be very slow
        complain(f"warning: {caution}")
    try:
        with Progress(session) as progress, session.stopping_gently():
            solution = outcome.as_far_as_it_came(
                lambda: hybridsim.simulate(
                    model,
                    (0.0, t_end),
                    integrator=args.integrator,
                    limits=outcome.limits(args),
                    progress=progress,
                    **settings,
                )
            )
    except UnknownOption as fault:  # its message is about a call in Python
        known = option_names(integrator_class(fault.integrator))
        close = near(fault.option, ("rtol", "atol", "max_step"))
        remedy = f"did you mean --{close[0].replace('_', '-')}?" if close else ""
        raise UsageError(
            f"--option {fault.option}: integrator {fault.integrator!r} has no such option",
            remedy=remedy or nearest(fault.option, known, kind=f"options of {fault.integrator}"),
        ) from None
    return solution, cautions


def run_settings(args: argparse.Namespace) -> dict[str, Any]:
    """Return the keyword arguments for `simulate` from the command line, without omitted arguments."""
    settings: dict[str, Any] = {
        name: getattr(args, name) for name in ("rtol", "atol", "max_step") if getattr(args, name) is not None
    }
    for name, text in args.option:
        if name in settings:
            raise UsageError(f"--option {name} occurs twice", remedy=f"use --option {name}=... only once")
        settings[name] = values.option_value(text)
    return settings


def _save_setting(args: argparse.Namespace) -> str | float:
    """Return the argument `save` for the run, and reject outputs that need data which the run does not store."""
    if args.keep in ("events", "nothing"):
        for option in ("plot", "animate", "csv", "npz"):
            if getattr(args, option):
                raise UsageError(
                    f"--{option} needs the states over time, which --keep {args.keep} does not store",
                    remedy="use --keep all, --keep last-period or --keep TIME",
                )
    if args.keep != "all" and args.explain:
        raise UsageError(f"--explain needs the whole run, but --keep is {args.keep}", remedy="remove --keep")
    if args.keep in ("all", "events", "last-period", "nothing"):
        return str(args.keep)
    try:
        return values.positive(args.keep)
    except argparse.ArgumentTypeError:
        raise UsageError(
            f"--keep: unknown value '{args.keep}'",
            remedy="use all, events, last-period, nothing, or a length of time above zero",
        ) from None
