"""`hybridsim study NAME`: reproduce a published study with verdicts on its claims, pictures and a page."""

from __future__ import annotations

import argparse
import os
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hybridsim.cli import options
from hybridsim.cli.output import print_json, require_folder, say
from hybridsim.cli.progress import Progress
from hybridsim.cli.session import Session
from hybridsim.files import write_text

if TYPE_CHECKING:
    from hybridsim.studies.he2026.measured import Study

STUDIES = ("he2026",)
_WIDTH = 100


def add_to(commands: Any) -> None:
    """Add the command `study` to the parser."""
    parser = commands.add_parser(
        "study",
        help="reproduce a published study",
        description="Reproduce a published study with the published method, compare every figure with the exact "
        "motion, and test every claim.",
        epilog="The folder receives NAME.json (verdicts), NAME.md (page) and NAME-*.png (pictures).",
    )
    parser.add_argument("name", metavar="NAME", choices=STUDIES, help="study to run: " + ", ".join(STUDIES))
    parser.add_argument(
        "--quick", action="store_true", help="use coarser grids and shorter runs (a few minutes)"
    )
    options.add_out(parser, "study-NAME")
    options.add(
        parser, "--images", "FOLDER", "folder for the pictures (default: the folder of the results)", Path
    )
    options.add_json(parser, "the verdicts")
    parser.set_defaults(execute=execute, lighter="--quick")


def execute(args: argparse.Namespace, session: Session) -> int:
    """Run the study, print the verdicts and write the results."""
    folder: Path = args.out or Path(f"study-{args.name}")
    images: Path = args.images or folder
    require_folder(folder, "--out")
    require_folder(images, "--images")

    from hybridsim.studies.he2026.measured import he2026

    with Progress(session) as progress:
        study = he2026(quick=args.quick, progress=progress)
    _write(study, args.name, folder, images, session)
    if args.json:
        print_json(study.to_plain())
    else:
        _print(study)
    return 0


def _print(study: Study) -> None:
    for name, verdict, why in study.rows():
        say(f"{name}: {verdict}")
        say(textwrap.fill(why, _WIDTH, initial_indent="  ", subsequent_indent="  "))


def _write(study: Study, name: str, folder: Path, images: Path, session: Session) -> None:
    from hybridsim.plot import save
    from hybridsim.studies.he2026.measured import page
    from hybridsim.studies.he2026.pictures import pictures

    folder.mkdir(parents=True, exist_ok=True)
    images.mkdir(parents=True, exist_ok=True)
    write_text(folder / f"{name}.json", study.to_json())
    session.wrote(folder / f"{name}.json")
    write_text(folder / f"{name}.md", page(study, lambda title: _link(title, name, folder, images)))
    session.wrote(folder / f"{name}.md")
    for title, draw in pictures(study).items():
        save(draw(), images / f"{name}-{title}.png")
        session.wrote(images / f"{name}-{title}.png")


def _link(title: str, name: str, folder: Path, images: Path) -> str:
    """Return the path of a picture relative to the page that shows it."""
    return Path(os.path.relpath(images / f"{name}-{title}.png", folder)).as_posix()
