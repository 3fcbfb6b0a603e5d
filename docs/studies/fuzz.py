"""Run mutated model files, random models with parts and mutated command lines, and look for internal errors.

    python docs/studies/fuzz.py [files] [parts] [lines] [--count N] [--seed S] [--results FOLDER] [--only K]

Without a kind all kinds run, with 10^4 cases each by default. This makes docs/studies/fuzz.md in half an hour on one
core. Findings are printed. Cases run in a child process. It is ended if a case takes longer than a minute, and begun
again after this case. With a folder for results the same command continues where it stopped. `--only K` runs the K-th
case alone and shows its result. Thousands of models are compiled, so use a separate cache folder in HYBRIDSIM_CACHE.
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
from fuzz.parts import parts_case

KINDS = {"files": file_case, "parts": parts_case, "lines": line_case}
COUNT = 10_000
PAGE = Path(__file__).parents[2] / "docs" / "studies" / "fuzz.md"
LIMIT = 60.0  # seconds of one case, compilation included; two processes on a core take twice their time
MEMORY = 6 << 30  # bytes of address space; more is refused


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
    """The results of all cases, with a new child process after each that was ended."""
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

Does a faulty model file or command line ever cause an internal error? {verdict} The script `docs/studies/fuzz.py`
ran {files} model files, {parts} models with parts and {lines} command lines. The files and command lines contain
typical mistakes of users, editors and scripts, and deliberate attacks. A case must not cause an internal error, a
traceback, a warning of a library, a hang or an unwanted file. The text of a file must not run as code.

## Model files

Each file is a model of the package or a scene of the atlas, with one or more of these changes:

- A line is lost, doubled or moved.
- A number is far out of range (5e-324, 1e308, a thousand digits).
- A type is wrong, or a key is misspelt.
- An expression is program code, has too many nested brackets, is too long, or has no value.
- The text has letters of other alphabets, control characters or bytes that are not text.

Each accepted file is checked for warnings. The model in the file then runs with a random integrator, over at most
one unit of simulated time. The limits of the run are 2 seconds, 5000 steps and 500 megabytes.

| ending | files |
| --- | --- |
{file_rows}

A file is *refused* if it cannot be loaded. The error names the fault and its place. An error *on running* occurs
only when the loaded model runs. For example, the method may lack a capability, or no mode may be possible at the
start. A case that takes longer than {limit:g} seconds is a *hang*. All other endings in the table are statuses of
runs.

## Models with parts

Each model has up to five parts from two other files, with random connections, values, laws and numbers of copies.
Some models have one of the faults that are listed for files, a wrong index or an unknown name. Each accepted model
is also written as one file without parts. The file without parts must give the same model. If a model is refused,
the error must name the file, the fault and a remedy.

| ending | models |
| --- | --- |
{parts_rows}

## Command lines

Each command line is a correct command with one or more changes. A word is lost, doubled, moved, misspelt or replaced.
The values in a command line are made faulty in the same ways as the numbers and expressions in a model file. Some
values are replaced by names of devices, of folders and of missing files. A command that runs longer than
{commanded:g} seconds is interrupted as by Ctrl-C.

| ending | command lines |
| --- | --- |
{line_rows}

The [reference](../reference/cli.md) lists the exit codes.

## Detection of faults

Each case runs in a process that records what the case does:

- The changed texts contain the names of a function and of a module. If this function is called or the module
  imported, the process records it.
- An audit hook detects every file opened for writing, every new folder, every started program and every connection.

An exception, a warning, an undocumented exit code, a failure without a message, and a hang are faults. Under
`--json`, output that is not JSON is a fault too.

All faults that earlier runs found are fixed, and each has a test in `tests/fuzz/test_found.py`. Most of the faults
found earlier were caused by very large or very small numbers, whose squares or quotients are infinite. In one fault
the bound of a guard was not a number, so that the search for a zero never ended. In other faults a message contained
a very long word. The tests of the package also run a few random cases of each kind.
"""


def page(found: dict[str, list[Case]]) -> str:
    """The page with the results of all kinds."""
    rows = {
        kind: "\n".join(
            f"| {END.get(end, end)} | {n} |" for end, n in Counter(c[1] for c in cases).most_common()
        )
        for kind, cases in found.items()
    }
    faulty = [f"{kind} {case[0]} ({case[1]})" for kind, cases in found.items() for case in cases if case[2]]
    return TEXT.format(
        files=len(found["files"]),
        parts=len(found["parts"]),
        lines=len(found["lines"]),
        file_rows=rows["files"],
        parts_rows=rows["parts"],
        line_rows=rows["lines"],
        commanded=COMMANDED,
        limit=LIMIT,
        verdict=f"These cases do: {', '.join(faulty)}."
        if faulty
        else "In this study no file and no command line causes an internal error.",
    )


END = {
    "exit code 0": "0, done",
    "exit code 1": "1, the simulation failed",
    "exit code 2": "2, bad usage",
    "exit code 3": "3, bad model",
    "exit code 130": "130, interrupted",
}


def main() -> None:
    """Run the selected kinds or one case."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kinds", nargs="*", metavar="KIND", help="files, parts, lines (default: all)")
    parser.add_argument("--count", type=int, default=COUNT, help="cases of each kind (default: 10000)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--results",
        type=Path,
        metavar="FOLDER",
        help="folder of the results, from which the command continues",
    )
    parser.add_argument("--only", type=int, metavar="K", help="this case alone, with its result")
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
            for path in sorted(folder.glob("*.toml")):
                print(path.read_bytes().decode(errors="backslashreplace")[:3000])
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
