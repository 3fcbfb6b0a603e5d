"""Of which sources the figures of the documentation are, and the commands that make them anew.

    python docs/make/figures.py                    one line a page: present or older, when made, how long that took
    python docs/make/figures.py --make [PAGE ...]  run the commands of these pages, of all older ones if none is named
    python docs/make/figures.py --done PAGE ...    a person has brought these up to date with what the commands print

The pages and their commands stand in docs/figures.toml. What was made is noted in docs/figures.json with a key of
those modules of the package that the commands can reach (`source_keys`), and of its data; the site says at the foot of
each page whether they are those that it was built from.
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
TABLE, NOTES = ROOT / "docs" / "figures.toml", ROOT / "docs" / "figures.json"
OF_DATA = (".toml", ".json", ".csv", ".npz")  # kinds of files in the package that results depend on


def sources(page: str) -> str:
    """Key of what the commands of a page use of the package: equal where every figure would come out alike."""
    used = set().union(*map(modules_of, table()[page]["commands"]))
    data = sorted(path for path in (ROOT / "hybridsim").rglob("*") if path.suffix in OF_DATA)
    return key((path.read_bytes() for path in used), (path.read_bytes() for path in data))


def table() -> dict[str, dict[str, Any]]:
    """Pages, relative to docs, with their commands."""
    return tomllib.loads(TABLE.read_text(encoding="utf-8"))


def notes() -> dict[str, dict[str, Any]]:
    """What was made of which sources."""
    return dict(json.loads(NOTES.read_text(encoding="utf-8"))) if NOTES.exists() else {}


def commit() -> str:
    """The commit that is checked out."""
    done = subprocess.run(
        ["git", "rev-parse", "--short=10", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def note(page: str, minutes: float | None) -> None:
    """Write down that the figures of a page are of the present sources."""
    noted = notes()
    before = noted.get(page, {}).get("minutes")
    noted[page] = {
        "sources": sources(page),
        "commit": commit(),
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "minutes": before if minutes is None else round(minutes, 1),
    }
    NOTES.write_text(json.dumps(dict(sorted(noted.items())), indent=1) + "\n", encoding="utf-8")


def footer(page: str) -> str:
    """What the site says under a page about its figures; nothing for a page that has none."""
    entry = table().get(page)
    if entry is None:
        return ""
    commands = " and ".join(f"`{command}`" for command in entry["commands"])
    noted = notes().get(page)
    if noted is None:
        return f"\n\n---\n\nFigures: {commands}, by sources from before they were noted.\n"
    same = (
        "those of this version" if noted["sources"] == sources(page) else "older than those of this version"
    )
    made = f"{commands}, {noted['date']}, at commit {noted['commit']}"
    return f"\n\n---\n\nFigures: {made}; the package's sources are {same}.\n"


def make(page: str) -> None:
    """Run the commands of a page; note it where that needs no person."""
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
    """Say how things are, or make them."""
    parser = argparse.ArgumentParser(description="Of which sources the figures of the documentation are.")
    parser.add_argument(
        "--make", action="store_true", help="run the commands of the pages, or of all older ones"
    )
    parser.add_argument("--done", action="store_true", help="note the pages as of the present sources")
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
