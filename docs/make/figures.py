"""Record which version of the code made the figures of each page, and run the commands that make them.

    python docs/make/figures.py                    print one line per page: present or older, when, how many minutes
    python docs/make/figures.py --make [PAGE ...]  run the commands of these pages, or of all older ones
    python docs/make/figures.py --done PAGE ...    record that a person has updated these pages

docs/figures.toml lists the pages and their commands. docs/figures.json holds a key of the code and data that the
commands of a page can reach (`source_keys`), and a key for each folder of them. The foot of each page on the site
gives the date and the commit of its figures, and names the folders that have changed since.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import shlex
import subprocess
import sys
import time
import tomllib
from pathlib import Path
from typing import Any

from source_keys import key
from used_sources import modules_of

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "hybridsim"
TABLE, NOTES = ROOT / "docs" / "figures.toml", ROOT / "docs" / "figures.json"
MOST_NAMED = 8  # folders within folders that a foot names; of more it names the folders at the top
OF_DATA = (".toml", ".json", ".csv", ".npz")  # kinds of files in the package that results depend on


def used(page: str) -> list[Path]:
    """List the modules that the commands of a page can reach, and the data of the package."""
    modules = set().union(*map(modules_of, table()[page]["commands"]))
    return sorted(modules | {path for path in PACKAGE.rglob("*") if path.suffix in OF_DATA})


def sources(page: str) -> str:
    """Return the key of the code and data of a page: it is equal if every figure would be the same."""
    return key_of(used(page))


def folders(page: str) -> dict[str, str]:
    """Return a key for each folder of the package that the commands of a page use."""
    paths: dict[str, list[Path]] = {}
    for path in used(page):
        inside = path.relative_to(PACKAGE)
        paths.setdefault("/".join(inside.parent.parts[:2]) or inside.name, []).append(path)
    return {folder: key_of(contents) for folder, contents in paths.items()}


def key_of(paths: list[Path]) -> str:
    """Return one key of modules and files of data."""
    return key(
        (path.read_bytes() for path in paths if path.suffix not in OF_DATA),
        (path.read_bytes() for path in paths if path.suffix in OF_DATA),
    )


def table() -> dict[str, dict[str, Any]]:
    """Return the pages, relative to docs, with their commands."""
    return tomllib.loads(TABLE.read_text(encoding="utf-8"))


def notes() -> dict[str, dict[str, Any]]:
    """Return what is recorded about each page."""
    return dict(json.loads(NOTES.read_text(encoding="utf-8"))) if NOTES.exists() else {}


def commit() -> str:
    """Return the commit that is checked out."""
    done = subprocess.run(
        ["git", "rev-parse", "--short=10", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def note(page: str, minutes: float | None) -> None:
    """Record that the present code made the figures of a page."""
    noted = notes()
    before = noted.get(page, {}).get("minutes")
    noted[page] = {
        "sources": sources(page),
        "folders": folders(page),
        "commit": commit(),
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "minutes": before if minutes is None else round(minutes, 1),
    }
    NOTES.write_text(json.dumps(dict(sorted(noted.items())), indent=1) + "\n", encoding="utf-8")


def footer(page: str) -> str:
    """Return the foot of a page: when its figures were made, by which commands, and what has changed since."""
    entry = table().get(page)
    if entry is None:
        return ""
    commands = " and ".join(f"`{command}`" for command in entry["commands"])
    noted = notes().get(page)
    if noted is None:
        return f"\n\n---\n\nFigures made by {commands}. The version of the code was not recorded.\n"
    made = f"Figures of {noted['date']}, commit {noted['commit']}, made by {commands}."
    return f"\n\n---\n\n{made} {changes(page, noted)}\n"


def changes(page: str, noted: dict[str, Any]) -> str:
    """Return a sentence that names the folders with other code than when the figures of a page were made."""
    if noted["sources"] == sources(page):
        return "The code that they depend on has not changed since."
    before, now = noted.get("folders"), folders(page)
    if before is None:
        return "The code that they depend on has changed since."
    other = sorted(name for name in before | now if before.get(name) != now.get(name))
    if len(other) > MOST_NAMED:
        other = sorted({name.partition("/")[0] for name in other})
    return f"This has changed since: {', '.join(f'`{name}`' for name in other)}."


def make(page: str) -> None:
    """Run the commands of a page, and record it unless a person has to carry the figures over."""
    entry, began = table()[page], time.perf_counter()
    beside = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    for command in entry["commands"]:
        print(f"{page}: {command}", flush=True)
        subprocess.run(command, shell=True, cwd=ROOT, env=os.environ | {"PATH": beside}, check=True)
    minutes = (time.perf_counter() - began) / 60
    if entry.get("by_hand"):
        print(f"{page}: {minutes:.1f} min; carry the figures over, then: --done {shlex.quote(page)}")
    else:
        note(page, minutes)


def main() -> None:
    """Print the state of the pages, or make their figures."""
    parser = argparse.ArgumentParser(description="Which version of the code made the figures of each page.")
    parser.add_argument(
        "--make", action="store_true", help="run the commands of the pages, or of all older ones"
    )
    parser.add_argument("--done", action="store_true", help="record the pages as made by the present code")
    parser.add_argument("pages", nargs="*", metavar="PAGE", help="as in docs/figures.toml")
    args = parser.parse_args()
    entries = table()
    unknown = [page for page in args.pages if page not in entries]
    if unknown:
        parser.error(f"not in docs/figures.toml: {', '.join(unknown)}")
    is_present = {page: notes().get(page, {}).get("sources") == sources(page) for page in entries}
    if args.done:
        for page in args.pages:
            note(page, None)
    elif args.make:
        for page in args.pages or [page for page, done in is_present.items() if not done]:
            make(page)
    else:
        for page in entries:
            noted = notes().get(page, {})
            state = "present" if is_present[page] else "older"
            print(f"{state:8}{page:32}{noted.get('commit', ''):12}{noted.get('minutes') or '':>8}")


if __name__ == "__main__":
    main()
