"""Whether the program survives what it is given: mutated model files and mutated command lines.

    python studies/fuzz.py [files] [lines] [--count N] [--seed S] [--only K]

Without a kind both, 10^4 of each unless told otherwise; half an hour on one core. Findings are printed. Cases are run
in a child process, which is ended where one of them takes longer than a minute, and begun again behind it. `--only K`
runs the K-th case alone and shows what becomes of it. Thousands of models are compiled: give it a cache folder of its
own in HYBRIDSIM_CACHE.
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

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from fuzz.judge import file_case, line_case, sandbox

KINDS = {"files": file_case, "lines": line_case}
COUNTS = {"files": 10_000, "lines": 10_000}
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


def all_cases(kind: str, seed: int, count: int) -> list[tuple[int, str, list[str], float]]:
    """What became of all cases, with a new child behind each that was ended."""
    found: list[tuple[int, str, list[str], float]] = []
    with tempfile.TemporaryDirectory() as folder:
        results = Path(folder) / "results"
        results.touch()
        while len(found) < count:
            command = [sys.executable, __file__, "--work", kind, str(len(found)), str(count), str(results)]
            child = subprocess.Popen(
                [*command, "--seed", str(seed)], stderr=subprocess.PIPE, text=True, encoding="utf-8"
            )
            done = len(found)
            said = child.communicate()[1]
            lines = results.read_text(encoding="utf-8").splitlines()
            found = [tuple(json.loads(line)) for line in lines]
            for number, _, faults, _ in found[done:]:
                for fault in faults:
                    print(f"{kind} {number}: {fault}", flush=True)
            if len(found) < count:
                print(f"{kind} {len(found)}: ended with {child.returncode}\n{said[-3000:]}", flush=True)
                end = "hang" if "Timeout" in said else f"death by {child.returncode}"
                with results.open("a", encoding="utf-8") as out:
                    out.write(json.dumps([len(found), end, [said[-3000:]], LIMIT]) + "\n")
                found.append((len(found), end, [said[-3000:]], LIMIT))
            print(f"{kind}: {len(found)} of {count}", flush=True)
    return found


def main() -> None:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kinds", nargs="*", metavar="KIND", help="files, lines (default: both)")
    parser.add_argument("--count", type=int, help="cases of each kind (default: 10000)")
    parser.add_argument("--seed", type=int, default=1)
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
    for kind in kinds:
        began = time.perf_counter()
        found = all_cases(kind, args.seed, args.count or COUNTS[kind])
        ends = Counter(end for _, end, _, _ in found)
        faulty = [case for case in found if case[2]]
        slow = sorted(case[3] for case in found)[-3:]
        print(kind, dict(ends), f"{len(faulty)} faulty, slowest {slow}, {time.perf_counter() - began:.0f} s")


if __name__ == "__main__":
    main()
