"""`hybridsim advise MODEL --quantity Q --tol TOL`: find the simplest model that is accurate enough."""

from __future__ import annotations

import argparse
from typing import Any

import hybridsim
from hybridsim.cli import options, values
from hybridsim.cli.output import complain, say
from hybridsim.cli.progress import Progress
from hybridsim.cli.session import Session
from hybridsim.cli.swept_values import number_of, values_by_name
from hybridsim.errors import UsageError
from hybridsim.model import Model

_EXAMPLES = """\
quantities of the steady motion, or of a run if --t-end is set: amplitude.x, peak.x, maximum.f, minimum.f, mean.x,
energy.x, harmonic.x.3, dissipated.f, stick_fraction.f, period. Only with --t-end: final.x, event_time.f.2.

examples:
  hybridsim advise dfcs -p F0=100 --quantity amplitude.x --tol 0.03
  hybridsim advise dfcs --quantity amplitude.x --uncertain mu=0.45:0.55
  hybridsim advise free-decay --quantity final.x --t-end 20
  hybridsim advise dfcs --quantity amplitude.x --over F0=16:60:12 'omega=0.2*sqrt(k/m):1.8*sqrt(k/m):17' --plot map.png
"""


def add_to(commands: Any) -> None:
    """Add the command `advise` to the parser."""
    parser = commands.add_parser(
        "advise",
        help="find the simplest model and the cheapest integrator that are accurate enough",
        description="Compare simpler models with the full model, and report the simplest one that computes a quantity "
        "within a tolerance. Compare integrator settings likewise. All errors and run times are measured.",
        epilog=_EXAMPLES,
    )
    options.add_model_arguments(parser)
    options.add(parser, "--quantity", "Q", "the quantity to compute (see below)", required=True)
    options.add(
        parser, "--tol", "TOL", "largest relative error (default: 0.01)", values.positive, default=0.01
    )
    options.add(parser, "--t-end", "TIME", "evaluate a run from 0 to this time instead of the steady motion")
    options.add(
        parser,
        "--over",
        "NAME=VALUES",
        "compute a map over parameter values, written FROM:TO:COUNT or A,B,C as in sweep",
        values.assignment,
        nargs="+",
    )
    options.add_repeated(
        parser,
        "--uncertain",
        "NAME=LOW:HIGH",
        "range of an uncertain parameter; the report compares its effect with the tolerance",
    )
    options.add(parser, "--rungs", "A,B", "simpler models to try (default: all)", values.names)
    options.add(
        parser,
        "--v0",
        "SPEED",
        "velocity width of the regularised forces (default: 1 %% of the largest sliding speed)",
        values.positive,
    )
    parser.add_argument(
        "--no-integrators", action="store_true", help="do not search for the cheapest integrator setting"
    )
    options.add_workers(parser, " for --over")
    options.add_budget(parser, "120; unlimited with --over")
    options.add_plot(parser, "the result")
    options.add_json(parser, "the result")
    parser.set_defaults(execute=execute, lighter="a shorter --t-end or a looser --tol")


def execute(args: argparse.Namespace, session: Session) -> int:
    """Compute the advice, print the table and draw the picture."""
    options.check_plot(args)
    model = values.changed_model(args)
    over = None if args.over is None else values_by_name(model, args.over)

    with Progress(session) as progress:
        found = hybridsim.advise(
            model,
            args.quantity,
            args.tol,
            over=over,
            uncertain=_ranges(model, args.uncertain) or None,
            t_span=None if args.t_end is None else (0.0, values.end_time(model, args.t_end)),
            rungs=args.rungs,
            v0=args.v0,
            integrators=not args.no_integrators,
            workers=args.workers,
            budget=args.budget,
            progress=progress.of_steps,
        )
    try:  # write files first: printing fails if the reader of the pipe has gone
        if args.plot:
            from hybridsim.plot import advice, save

            save(advice(found), args.plot)
            session.wrote(args.plot)
    finally:
        say(found.to_json() if args.json else found.table())
    if found.region is not None:
        for error, count in found.region.problems():
            complain(f"{count} of {found.region.status.size} points failed: {error}")
    return 0


def _ranges(model: Model, pairs: list[tuple[str, str]]) -> dict[str, tuple[float, float]]:
    """Return the range of each uncertain parameter; the ends of a range may be expressions."""
    found = {}
    for name, text in pairs:
        low, colon, high = text.partition(":")
        if not colon:
            raise UsageError(
                f"--uncertain: cannot read '{name}={text}'", remedy=f"use {name}=LOW:HIGH with two numbers"
            )
        with values.blaming_the_command_line():
            found[name] = (number_of(model, name, low), number_of(model, name, high))
    return found
