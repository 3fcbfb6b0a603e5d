"""`hybridsim advise MODEL --quantity Q --tol TOL`: how little model, and which integrator, is enough."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from hybridsim.cli import options, values
from hybridsim.cli.output import complain, say
from hybridsim.cli.progress import Progress
from hybridsim.cli.session import Session
from hybridsim.cli.sweep import values_by_name
from hybridsim.errors import UsageError

if TYPE_CHECKING:
    from hybridsim.model import Model

_EXAMPLES = """\
quantities: amplitude.x, peak.x, maximum.f, minimum.f, mean.x, energy.x, harmonic.x.3, dissipated.f, stick_fraction.f,
period: of the steady motion, or with --t-end of a run; of a run alone final.x and event_time.f.2.

examples:
  hybridsim advise dfcs -p F0=100 --quantity amplitude.x --tol 0.03
  hybridsim advise dfcs --quantity amplitude.x --uncertain mu=0.45:0.55
  hybridsim advise free-decay --quantity final.x --t-end 20
  hybridsim advise dfcs --quantity amplitude.x --over F0=16:60:12 'omega=0.2*sqrt(k/m):1.8*sqrt(k/m):17' --plot map.png
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "advise",
        help="say how little model, and which integrator, is enough for a question",
        description="Hold a ladder of simpler models against the full one, and name the simplest that gives a quantity "
        "within a tolerance, with errors and costs that are measured; likewise integrator settings.",
        epilog=_EXAMPLES,
    )
    values.add_model_arguments(parser)
    parser.add_argument("--quantity", metavar="Q", required=True, help="what is asked: see below")
    parser.add_argument(
        "--tol",
        metavar="TOL",
        type=values.positive,
        default=0.01,
        help="largest relative error (default: 0.01)",
    )
    parser.add_argument("--t-end", metavar="TIME", help="ask about a run from 0 to this time (as in run)")
    parser.add_argument(
        "--over",
        metavar="NAME=VALUES",
        nargs="+",
        type=values.assignment,
        help="a map over values of parameters, FROM:TO:COUNT or A,B,C, as in sweep",
    )
    parser.add_argument(
        "--uncertain",
        metavar="NAME=LOW:HIGH",
        type=values.assignment,
        action="append",
        default=[],
        help="a parameter is known in this range only: is the tolerance finer than that?",
    )
    parser.add_argument(
        "--rungs", metavar="A,B", type=values.names, help="simpler models to try (default: all)"
    )
    parser.add_argument(
        "--v0",
        metavar="SPEED",
        type=values.positive,
        help="width of regularised forces (default: a hundredth of the largest sliding speed)",
    )
    parser.add_argument("--no-integrators", action="store_true", help="try no integrator settings")
    options.add_workers(parser, " of --over")
    options.add_budget(parser, "120; with --over as long as it takes")
    options.add_plot(parser, "it")
    options.add_json(parser, "everything")
    parser.set_defaults(execute=execute, lighter="a shorter --t-end or a looser --tol")


def execute(args: argparse.Namespace, session: Session) -> int:
    """Ask, print the table and draw the picture."""
    options.check_plot(args)
    model = values.changed_model(args)
    over = None if args.over is None else values_by_name(model, args.over)

    import hybridsim

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
    try:  # before anything is printed to a reader who may have gone
        if args.plot:
            from hybridsim.plot import advice, save

            save(advice(found), args.plot)
            session.wrote(args.plot)
    finally:
        say(found.to_json() if args.json else found.table())
    if found.region is not None:
        for text, count in found.region.problems():
            complain(f"{count} of {found.region.status.size} points: {text}")
    return 0


def _ranges(model: Model, pairs: list[tuple[str, str]]) -> dict[str, tuple[float, float]]:
    """Ranges of parameters; each end may be an expression."""
    from hybridsim.cli.sweep import number_of

    found = {}
    for name, text in pairs:
        low, colon, high = text.partition(":")
        if not colon:
            raise UsageError(f"--uncertain {name}={text}", remedy="write NAME=LOW:HIGH")
        with values.blaming_the_command_line():
            found[name] = (number_of(model, name, low), number_of(model, name, high))
    return found
