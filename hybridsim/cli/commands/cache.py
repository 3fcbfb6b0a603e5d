"""`hybridsim cache`: show or clear the cache of compiled code, or compile the engine ahead of time."""

from __future__ import annotations

import argparse
from typing import Any

import hybridsim
from hybridsim.cli.output import complain, say
from hybridsim.cli.session import Session


def add_to(commands: Any) -> None:
    """Add the command `cache` to the parser."""
    parser = commands.add_parser(
        "cache",
        help="show, clear or fill the cache of compiled code",
        description="Show, clear or fill the folder that caches compiled code.",
        epilog="Set HYBRIDSIM_CACHE=FOLDER to move the cache, and HYBRIDSIM_JIT=0 to run without compiling.",
    )
    parser.add_argument(
        "action",
        choices=("path", "clear", "warm"),
        help="path: print the folder; clear: delete the compiled code in it; warm: compile the engine now",
    )
    parser.set_defaults(execute=execute)


def execute(args: argparse.Namespace, session: Session) -> int:
    """Run the chosen action: path, clear or warm."""
    from hybridsim.engine.native.cache import cache_root, clear, kernel_folder

    root = cache_root()
    if root is None or (args.action == "warm" and kernel_folder() is None):
        return 1  # a warning has reported the reason
    if args.action == "path":
        say(str(root))
    elif args.action == "clear":
        freed, others = clear()
        complain(f"deleted {freed / 1e6:.1f} MB in {root}")
        for folder in others:
            complain(f"{folder} was not deleted, because hybridsim did not create it")
    else:
        _warm()
    return 0


def _warm() -> None:
    """Compile all kernels by a short run of a reference model with each integrator."""
    from hybridsim.engine.system.period import forcing_period

    model = hybridsim.load("dfcs")
    period = forcing_period(model)
    assert period is not None, "the reference model is forced by a sine"
    for integrator in hybridsim.list_integrators():
        complain(f"compiling {integrator.name}")
        solution = hybridsim.simulate(model, (0.0, period), integrator=integrator.name)
        solution(solution.t)  # compiles the kernels of the dense output
