"""Put each mended fault back alone and test whether random trials find it.

    python docs/studies/faults_put_back.py [journal] [fault ...]      (without a name: all)

The table of faults is tests/reference/put_back/faults.toml, and the trials are in tests/reference/combined. Each fault
is put back into a copy of the package in a temporary folder. Structures are drawn until one run is not as it should be
that is as it should be with the package as it stands. The page is written if all faults have been tried.
"""

from __future__ import annotations

import importlib
import json
import multiprocessing as mp
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from reference.put_back.copies import Fault, copied, faults  # noqa: E402  # after the path

PAGE = ROOT / "docs" / "studies" / "faults-put-back.md"
RESULTS = "## Results"
MOST = 300  # structures of a trial
COMPILED = ("reactions", "repeated runs")  # trials with compiled code; the others take less time without it
LONGEST = (
    20.0,
    200.0,
)  # seconds of the processor for a structure: by Python alone, and with the time of compiling
PATIENCE = 1200.0  # seconds without a sign after which a process is ended, whatever it is at
HEAVY = (
    "numpy",
    "scipy.integrate",
    "scipy.linalg",
    "scipy.sparse.linalg",
    "sympy",
    "mpmath",
)  # forks share them


class OutOfTime(BaseException):
    """A structure takes more processor time than it may; not an `Exception`, so that nothing handles it."""


def stop(*_: Any) -> None:
    """End the structure that is being tried."""
    raise OutOfTime


def work(package: Path, trial: str, numbers: list[int], longest: float, out: Any) -> None:
    """Make the trials of these numbers with the package of a folder, up to the first that is not quiet."""
    os.environ["HYBRIDSIM_JIT"] = "1" if trial in COMPILED else "0"
    sys.path.insert(0, str(package))
    import hybridsim

    assert Path(hybridsim.__file__).is_relative_to(package)
    from reference.combined.further import TRIALS

    signal.signal(signal.SIGPROF, stop)
    for number in numbers:
        out.send((number, None))
        signal.setitimer(signal.ITIMER_PROF, longest)
        try:
            record = next(TRIALS[trial](number), None)
        except OutOfTime:
            record = {"kind": "hangs", "detail": "it takes too much processor time"}
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        if record is not None:
            out.send((number, record))
            return
    out.send((-1, None))


def found(package: Path, trial: str, numbers: list[int], longest: float) -> tuple[int, Any]:
    """The first structure of these numbers that is not as it should be, and what was seen; -1 if there is none."""
    ours, theirs = mp.get_context("fork").Pipe(duplex=False)
    arguments = (package, trial, numbers, longest, theirs)
    process = mp.get_context("fork").Process(target=work, args=arguments, daemon=True)
    process.start()
    theirs.close()
    number = numbers[0]
    try:
        while ours.poll(PATIENCE):
            number, record = ours.recv()
            if number < 0 or record is not None:
                return number, record
        return number, {"kind": "hangs", "detail": f"no result within {PATIENCE:g} s"}
    except EOFError:
        return number, {"kind": "dies", "detail": "the process ended"}
    finally:
        process.kill()
        process.join()


def search(fault: Fault, folder: Path, first: int = 0) -> dict[str, Any]:
    """The first structure that finds a fault, among as many as are drawn."""
    package, longest = copied(folder / fault.name, fault), LONGEST[fault.trial in COMPILED]
    while first < MOST:
        number, record = found(package, fault.trial, list(range(first, MOST)), longest)
        if number < 0:
            break
        # what takes nearly as long without the fault is not found by it
        if found(folder / "as-it-stands", fault.trial, [number], longest / 4)[0] < 0:
            return {"fault": fault.name, "structures": number + 1, "by": record}
        print(f"not by {fault.name} alone: structure {number}, {record}", file=sys.stderr, flush=True)
        first = number + 1
    return {"fault": fault.name, "structures": MOST, "by": None}


def by_test(fault: Fault, folder: Path) -> dict[str, Any]:
    """Whether a test of the repository finds a fault."""
    package = copied(folder / fault.name, fault)
    options = ["-q", "-x", "-n0", "-p", "no:cacheprovider", "-p", "no:randomly"]
    done = subprocess.run(
        [sys.executable, "-P", "-m", "pytest", *options, str(ROOT / fault.test)],
        env=os.environ | {"PYTHONPATH": str(package)},
        capture_output=True,
        text=True,
        cwd=folder,
    )
    last = [line for line in done.stdout.splitlines() if line.startswith("FAILED")]
    by = {"kind": "test", "detail": last[0]} if done.returncode == 1 and last else None
    return {"fault": fault.name, "structures": 0, "by": by}


def shown(by: dict[str, Any] | None) -> str:
    """What a finding is, in a cell of a table."""
    if by is None:
        return "not found"
    where = f" by `{by['integrator']}`" if by.get("integrator") else ""
    text = " ".join(str(by.get("detail", "")).split()).replace("|", "\\|")
    return f"{by['kind']}{where}: {text[:120]}{'...' if len(text) > 120 else ''}"


def table(done: list[dict[str, Any]]) -> str:
    """The results as a table."""
    results = {one["fault"]: one for one in done}
    answers = [f for f in faults() if f.trial != "test"]
    count = sum(results[f.name]["by"] is not None for f in answers)
    out = f"The trials find {count} of the {len(answers)} faults ({100 * count / len(answers):.0f} %).\n\n"
    out += "| fault | trial | structures | what was seen |\n| --- | --- | --- | --- |\n"
    for fault in answers:
        one = results[fault.name]
        out += f"| {fault.words} | {fault.trial} | {one['structures']} | {shown(one['by'])} |\n"
    out += (
        "\nThe trials do not cover files and the cache. For each fault of this kind the table names a "
        "test:\n\n"
    )
    out += "| fault | test | found |\n| --- | --- | --- |\n"
    for fault in faults():
        if fault.trial == "test":
            is_found = "yes" if results[fault.name]["by"] else "no"
            out += f"| {fault.words} | `{fault.test}` | {is_found} |\n"
    return out


def main() -> None:
    """Try the faults that are named, or all."""
    journal = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("faults-put-back.jsonl")
    done = [json.loads(line) for line in journal.read_text().splitlines()] if journal.exists() else []
    known = {one["fault"] for one in done}
    for name in HEAVY:
        importlib.import_module(name)
    with tempfile.TemporaryDirectory() as temporary, journal.open("a", encoding="utf-8") as out:
        folder = Path(temporary)
        copied(folder / "as-it-stands")
        for fault in faults():
            if fault.name in known or (sys.argv[2:] and fault.name not in sys.argv[2:]):
                continue
            one = (by_test if fault.trial == "test" else search)(fault, folder)
            done.append(one)
            print(json.dumps(one), flush=True)
            out.write(json.dumps(one) + "\n")
            out.flush()
    if {fault.name for fault in faults()} <= {one["fault"] for one in done}:
        head, _, _ = PAGE.read_text(encoding="utf-8").partition(RESULTS)
        PAGE.write_text(f"{head}{RESULTS}\n\n{table(done)}", encoding="utf-8")


if __name__ == "__main__":
    main()
