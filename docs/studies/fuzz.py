"""Whether the program survives what it is given: mutated model files and mutated command lines.

    python docs/studies/fuzz.py [files] [lines] [--count N] [--seed S] [--results FOLDER] [--only K]

Without a kind both, 10^4 of each unless told otherwise; half an hour on one core; that makes
docs/studies/fuzz.md. Findings are printed. Cases are run in a child process, which is ended where one of them
takes longer than a minute, and begun again behind it. With a folder for results the same command goes on where
it stopped. `--only K` runs the K-th case alone and shows what becomes of it. Thousands of models are compiled:
give it a cache folder of its own in HYBRIDSIM_CACHE.
"""

from __future__ import annotations

import argparse
import faulthandler
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from fuzz.judge import COMMANDED, file_case, line_case, sandbox

KINDS = {"files": file_case, "lines": line_case}
COUNT = 10_000
PAGE = Path(__file__).parents[2] / "docs" / "studies" / "fuzz.md"
LIMIT = 60.0  # seconds of one case, compilation included; two processes on a core take twice their time
MEMORY = 6 << 30  # bytes of address space; what asks for more is told so


def work(kind: str, seed: int, first: int, last: int, results: Path) -> None:
    """The cases from first on, each written down before it begins and when it is done."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    with sandbox() as folder, results.open("a", encoding="utf-8") as out:
        for number in range(first, last):
            faulthandler.dump_traceback_later(LIMIT, exit=True)
            began = time.perf_counter()
            finding = KINDS[kind](seed, number, folder)
            took = time.perf_counter() - began
            faulthandler.cancel_dump_traceback_later()
            out.write(json.dumps([number, finding.end, finding.faults, took]) + "\n")
            out.flush()


Case = tuple[int, str, list[str], float]  # number, ending, faults, seconds


def all_cases(kind: str, seed: int, count: int, results: Path) -> list[Case]:
    """What became of all cases, with a new child behind each that was ended."""
    results.touch()
    found = read(results)
    while len(found) < count:
        done = len(found)
        child = subprocess.Popen(
            [sys.executable, __file__, "--work", kind, str(done), str(count), str(results), "--seed", str(seed)],
            stderr=subprocess.PIPE, text=True, encoding="utf-8",
        )  # fmt: skip
        said = child.communicate()[1]
        found = read(results)
        for number, _, faults, _ in found[done:]:
            for fault in faults:
                print(f"{kind} {number}: {fault}", flush=True)
        if len(found) < count:
            print(f"{kind} {len(found)}: ended with {child.returncode}\n{said[-3000:]}", flush=True)
            end = "hang" if "Timeout" in said else f"death by {child.returncode}"
            with results.open("a", encoding="utf-8") as out:
                out.write(json.dumps([len(found), end, [said[-3000:]], LIMIT]) + "\n")
            found = read(results)
        print(f"{kind}: {len(found)} of {count}", flush=True)
    return found[:count]


def read(results: Path) -> list[Case]:
    """The cases of a file of results."""
    lines = results.read_text(encoding="utf-8").splitlines()
    return [(number, end, faults, seconds) for number, end, faults, seconds in map(json.loads, lines)]


TEXT = """# Wrong files, wrong command lines

Made by `docs/studies/fuzz.py`, which runs the program on what people, editors and scripts get wrong, and on what
somebody may try who means harm. Nothing of it may end in an internal error, a traceback, a warning of a
library, a hang or a file that nobody asked for, and no text of a file may ever run as code.

## Model files

{files} files, each a model of the package or a scene of the atlas with one to a few changes: a line lost,
doubled or moved, a number out of all range (5e-324, 1e308, a thousand digits), a wrong type, a misspelt key, an
expression that is code, too deep, too long or without a value, letters of other scripts, control characters,
bytes that are no text. Each file that is taken is looked over for warnings and run for up to a second of its
time, with an integrator drawn at random and limits of 2 seconds, 5000 steps and 500 megabytes.

| ending | files |
| --- | --- |
{file_rows}

A *refusal* is an error that names what is wrong and where. An error *on running* is one that only the run can
find: a method that lacks what the model needs, a start in no mode. A *hang* would be what takes longer than {limit:g}
seconds by the clock. The others are the status of the run.

## Command lines

{lines} command lines, each a right one of any of the commands with one to a few changes: a word lost, doubled,
moved, misspelt or replaced, values of all the kinds above, names of devices, of folders and of files that are
not there. What runs longer than {commanded:g} seconds is interrupted as by Ctrl-C.

| ending | command lines |
| --- | --- |
{line_rows}

The exit codes are [those of the reference](../reference/cli.md).

## What is watched

Each case runs in a process that is looked at from inside: a function and a module whose names stand in the
mutated texts tell when they are reached; an audit hook sees every file that is opened for writing, every folder
made, every program started and every connection opened. Exceptions, warnings, an exit code that is not
documented, a failure without a message, output that is no JSON under `--json`, and {limit:g} seconds without an
end are faults.

{verdict}

Everything else that was found in this and in earlier runs is mended, and is a test in
`tests/fuzz/test_found.py`: numbers at the ends of the range of doubles above all, whose squares and quotients
are infinite, a guard whose bound is no number and whose search never ended, and messages as long as the word
that they are about. A few cases of each kind run with the tests.
"""


def page(found: dict[str, list[Case]]) -> str:
    """The page of what became of both kinds."""
    rows = {
        kind: "\n".join(
            f"| {END.get(end, end)} | {n} |" for end, n in Counter(c[1] for c in cases).most_common()
        )
        for kind, cases in found.items()
    }
    faulty = [f"{kind} {case[0]} ({case[1]})" for kind, cases in found.items() for case in cases if case[2]]
    return TEXT.format(
        files=len(found["files"]),
        lines=len(found["lines"]),
        file_rows=rows["files"],
        line_rows=rows["lines"],
        commanded=COMMANDED,
        limit=LIMIT,
        verdict=f"Cases of this run with a fault: {', '.join(faulty)}."
        if faulty
        else "No case of this run has one.",
    )


END = {
    "exit code 0": "0, done",
    "exit code 1": "1, the simulation failed",
    "exit code 2": "2, bad usage",
    "exit code 3": "3, bad model",
    "exit code 130": "130, interrupted",
}


def main() -> None:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kinds", nargs="*", metavar="KIND", help="files, lines (default: both)")
    parser.add_argument("--count", type=int, default=COUNT, help="cases of each kind (default: 10000)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--results", type=Path, metavar="FOLDER", help="where results are kept, to go on from"
    )
    parser.add_argument("--only", type=int, metavar="K", help="this case alone, with what became of it")
    parser.add_argument("--work", nargs=4, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.work:
        kind, first, last, results = args.work
        work(kind, args.seed, int(first), int(last), Path(results))
        return
    kinds = args.kinds or list(KINDS)
    if args.only is not None:
        with sandbox() as folder:
            print(KINDS[kinds[0]](args.seed, args.only, folder))
            print((folder / "case.toml").read_bytes().decode(errors="backslashreplace")[:3000])
        return
    found = {}
    with tempfile.TemporaryDirectory() as temporary:
        folder = args.results or Path(temporary)
        folder.mkdir(exist_ok=True)
        for kind in kinds:
            began = time.perf_counter()
            found[kind] = all_cases(kind, args.seed, args.count, folder / f"{kind}-{args.seed}")
            ends = Counter(end for _, end, _, _ in found[kind])
            faulty = [case for case in found[kind] if case[2]]
            slow = sorted(case[3] for case in found[kind])[-3:]
            spent = time.perf_counter() - began
            print(kind, dict(ends), f"{len(faulty)} faulty, slowest {slow}, {spent:.0f} s")
    if set(found) == set(KINDS) and args.count >= COUNT:
        PAGE.write_text(page(found), encoding="utf-8")


if __name__ == "__main__":
    main()
