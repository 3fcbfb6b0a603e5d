"""`hybridsim run MODEL`: simulate a model, say how it went, and write what was asked for."""

from __future__ import annotations

import argparse
from typing import Any

from hybridsim.cli import options, outcome, values
from hybridsim.cli.output import complain
from hybridsim.cli.progress import Progress
from hybridsim.cli.session import Session
from hybridsim.errors import UsageError

_EXAMPLES = """\
examples:
  hybridsim run dfcs
  hybridsim run dfcs -p F0=22 -p 'omega=0.64*sqrt(k/m)' --t-end 20T --plot out.png
  hybridsim run my.toml --integrator cvode-bdf --rtol 1e-10 --csv out.csv --json > out.json
  hybridsim run belt --t-end 1e4 --limit events=500 --save belt.hsol
  hybridsim run dfcs --t-end 1e6T --keep last-period --plot out.png
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "run",
        help="simulate a model",
        description="Simulate a model, say how it went, and write what was asked for.",
        epilog=_EXAMPLES,
    )
    values.add_model_arguments(parser)
    values.add_span_argument(parser)
    options.add_integrator(parser)
    options.add_rtol(parser, "1e-9")
    parser.add_argument(
        "--atol",
        metavar="TOL",
        type=values.positive,
        help="absolute tolerance of every state (default: rtol * 1e-3 * the state's nominal size)",
    )
    parser.add_argument("--max-step", metavar="TIME", type=values.positive, help="longest step allowed")
    parser.add_argument(
        "--option",
        metavar="NAME=VALUE",
        type=values.assignment,
        action="append",
        default=[],
        help="set an option of the integrator itself",
    )
    parser.add_argument(
        "--keep",
        metavar="WHAT",
        help="what is kept; the run stays the same. all: everything (the default). events: no states between the "
        "events (memory grows with them). last-period, or a number: the end of the run alone, so many units of t. "
        "nothing: the state at the end. --plot, --csv and --npz are refused with events and nothing, --explain with "
        "all but all",
    )
    outcome.add_arguments(parser)
    parser.set_defaults(
        execute=execute,
        lighter="a shorter --t-end or a looser --rtol; --limit megabytes=1000 stops with what there is",
    )


def execute(args: argparse.Namespace, session: Session) -> int:
    """Simulate, print the summary, write the files; 1 where the simulation did not succeed."""
    outcome.check_arguments(args)
    settings = _settings(args)
    model = values.changed_model(args)
    t_end = values.end_time(model, args.t_end)

    import hybridsim
    from hybridsim.model.hygiene import forces_of, jumps_of

    cautions = [caution.sentence for caution in (*jumps_of(model), *forces_of(model))]
    for caution in cautions:  # now, and not after a run that may crawl
        complain(f"warning: {caution}")
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
    return outcome.deliver(solution, args, session, told=cautions)


def _settings(args: argparse.Namespace) -> dict[str, Any]:
    """Keywords for `simulate`; what was not given is left to its defaults."""
    settings: dict[str, Any] = {
        name: getattr(args, name) for name in ("rtol", "atol", "max_step") if getattr(args, name) is not None
    }
    if args.keep is not None:
        settings["save"] = _kept(args)
    for name, text in args.option:
        if name in settings:
            raise UsageError(f"--option {name} is given twice", remedy="give one value")
        settings[name] = values.option_value(text)
    return settings


def _kept(args: argparse.Namespace) -> str | float:
    """What is kept of the run; what cannot be written of so little is refused before the run."""
    if args.keep in ("events", "nothing"):
        for option in ("plot", "csv", "npz"):
            if getattr(args, option):
                raise UsageError(
                    f"--{option} with --keep {args.keep}: no states are kept but those at the end",
                    remedy="keep last-period, or the last so much time",
                )
    if args.keep != "all" and args.explain:
        raise UsageError(
            f"--explain with --keep {args.keep}: events are explained from a whole run",
            remedy="leave --keep out",
        )
    if args.keep in ("all", "events", "last-period", "nothing"):
        return str(args.keep)
    try:
        return values.positive(args.keep)
    except argparse.ArgumentTypeError:
        raise UsageError(
            f"--keep {args.keep}",
            remedy="give all, events, last-period, nothing, or a length of time above zero",
        ) from None
