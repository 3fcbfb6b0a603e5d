"""`hybridsim atlas [SCENE ...]`: run every integrator on the test cases of the benchmark and report each failure."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hybridsim.cli import options, values
from hybridsim.cli.output import complain, print_json, require_folder, say
from hybridsim.cli.progress import Progress
from hybridsim.cli.session import Session
from hybridsim.errors import UsageError
from hybridsim.files import cannot_write, write_text

if TYPE_CHECKING:
    from hybridsim.testing.atlas import Atlas

_FOLDER = Path("atlas")


def add_to(commands: Any) -> None:
    """Add the command `atlas` to the parser."""
    parser = commands.add_parser(
        "atlas",
        help="run all integrators on benchmark problems (scenes) and report failures",
        description="Run benchmark problems (scenes) with known answers, with every integrator and with other common "
        "methods. Report for each pair: right, wrong answer, wrong mode sequence, hang (bounded by a time limit), or "
        "refused.",
        epilog="The folder receives atlas.json, index.md with a table of all verdicts, and a page and a folder of "
        "pictures for each class. A full run takes about ten minutes on two processors.",
    )
    parser.add_argument("scenes", metavar="SCENE", nargs="*", help="run only these scenes (default: all)")
    options.add(parser, "--class", "CLASS", "run only the scenes of this class", default="", dest="trouble")
    parser.add_argument("--list", action="store_true", help="print the scenes by class and exit")
    options.add(
        parser,
        "--integrators",
        "A,B",
        "run only these integrators with their variants, or single variants such as 'rk4 tanh' (default: all)",
        values.names,
    )
    parser.add_argument(
        "--quick", action="store_true", help="run only the loosest setting, which finds gross failures"
    )
    options.add(parser, "--workers", "N", "number of processes (default: one per processor)", values.workers)
    options.add_out(parser, "atlas")
    options.add_json(parser, "all verdicts")
    parser.set_defaults(execute=execute, lighter="fewer scenes at a time or fewer --workers")


def execute(args: argparse.Namespace, session: Session) -> int:
    """Run the test cases, print a table of counts and write the results."""
    if args.scenes and args.trouble:
        raise UsageError(
            "names of scenes and --class cannot be combined",
            remedy="remove --class or the names of the scenes",
        )
    from hybridsim.testing.atlas import atlas, described, listing, scenes_named

    scenes = scenes_named(args.scenes, args.trouble)
    if args.list:
        if args.json:
            print_json([described(scene) for scene in scenes])
        else:
            say(listing(scenes))
        return 0
    folder: Path = args.out or _FOLDER
    require_folder(folder, "--out")
    with Progress(session) as progress:
        result = atlas(
            scenes,
            args.integrators,
            quick=args.quick,
            workers=args.workers or os.cpu_count() or 1,
            progress=progress,
        )
        if result.interrupted and not result.scenes:
            raise KeyboardInterrupt
        fault: UsageError | None = None
        try:
            _write(result, folder, session, progress)
        except OSError as failed:  # access rights may promise more than the file system allows
            fault = cannot_write(folder, failed)
        except UsageError as failed:
            fault = failed
    if args.json:
        print_json(result.to_plain())
    else:
        say(result.table())
    if fault is not None:
        raise fault
    if result.interrupted:
        complain(f"interrupted after {len(result.scenes)} of {len(scenes)} scenes")
        return session.interrupted_code
    return 0


def _write(result: Atlas, folder: Path, session: Session, progress: Progress) -> None:
    """Write data, pages and pictures; write only the data if the run was interrupted."""
    from hybridsim.testing.atlas import pages

    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "atlas.json", result.to_json())
    session.wrote(folder / "atlas.json")
    if result.interrupted:
        return
    drawn = _pictures(result, folder, progress)
    for name, text in pages(result, drawn).items():
        write_text(folder / name, text)
        session.wrote(folder / name)


def _pictures(result: Atlas, folder: Path, progress: Progress) -> set[str]:
    """Draw each test case into the folder of its class, and return the names of the drawn test cases."""
    from hybridsim.plot.atlas import save_small
    from hybridsim.plot.atlas import scene as picture
    from hybridsim.testing.atlas import example

    drawn = set()
    for number, scene in enumerate(result.scenes):
        progress(number / len(result.scenes), f"drawing {scene.name}")
        found = example(result, scene)
        if found is not None:
            place = folder / (scene.trouble or "scenes")
            place.mkdir(exist_ok=True)
            save_small(picture(found), place / f"{scene.name}.png")
            drawn.add(scene.name)
    return drawn
