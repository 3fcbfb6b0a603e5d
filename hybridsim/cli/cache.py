"""`hybridsim cache`: where compiled functions are kept; clear them, or compile the engine ahead of time."""

from __future__ import annotations

import argparse
from typing import Any

from hybridsim.cli.output import complain, say
from hybridsim.cli.session import Session


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "cache",
        help="show, clear or fill the folder of compiled functions",
        description="Show, clear or fill the folder where compiled functions are kept.",
        epilog="HYBRIDSIM_CACHE=FOLDER puts the cache elsewhere; HYBRIDSIM_JIT=0 runs without compiling.",
    )
    parser.add_argument(
        "action",
        choices=("path", "clear", "warm"),
        help="path: print the folder; clear: delete the compiled code in it; warm: compile the engine now",
    )
    parser.set_defaults(execute=execute)


def execute(args: argparse.Namespace, session: Session) -> int:
    """Do what `action` says."""
    from hybridsim.engine.cache import cache_root, clear, kernel_folder

    root = cache_root()
    if root is None or (args.action == "warm" and kernel_folder() is None):
        return 1  # the reason is told already
    if args.action == "path":
        say(str(root))
    elif args.action == "clear":
        freed, others = clear()
        complain(f"freed {freed / 1e6:.1f} MB in {root}")
        for other in others:
            complain(f"{other} is left alone: hybridsim did not mark it as its own")
    else:
        _warm()
    return 0


def _warm() -> None:
    """Compile everything that a run needs, by a short run of the reference model with every integrator."""
    import hybridsim
    from hybridsim.engine.period import forcing_period

    model = hybridsim.load("dfcs")
    period = forcing_period(model)
    assert period is not None, "the reference model is forced by a sine"
    for integrator in hybridsim.list_integrators():
        complain(f"warming {integrator.name}")
        solution = hybridsim.simulate(model, (0.0, period), integrator=integrator.name)
        solution(solution.t)  # the dense output has kernels of its own
