"""One case of each kind, run and judged: what became of it, and what is wrong with that."""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
import re
import shutil
import signal
import tempfile
import threading
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import hybridsim as hs
from fuzz import mutated_files, mutated_lines
from fuzz.watch import watching
from hybridsim.cli import main
from hybridsim.cli.output import TRIAL
from hybridsim.engine.native.cache import chosen_root
from hybridsim.model.checks.doubtful import warnings_of

ROOT = Path(__file__).parents[2]
MODELS = ROOT / "models"
TEXTS = [
    path.read_text(encoding="utf-8")
    for path in sorted([*MODELS.glob("*.toml"), *MODELS.glob("laws/*.toml")])
    + sorted((ROOT / "hybridsim" / "testing" / "scenes").glob("*.toml"))
]
INTEGRATORS = ("auto",) * 6 + (
    "dop853",
    "taylor",
    "tsit5",
    "rodas5p",
    "exact",
    "moreau",
    "rk4-dichotomy",
    "scipy-rk45",
)
STATUSES = {
    "finished", "limit", "failed", "nonunique", "inconsistent", "accumulated", "terminated", "interrupted",
}  # fmt: skip
COMMANDED = 4.0  # seconds after which a command line is interrupted as by Ctrl-C


@dataclass
class Finding:
    """What became of a case, and what is wrong with that."""

    end: str
    faults: list[str] = field(default_factory=list)


def file_case(seed: int, number: int, folder: Path) -> Finding:
    """A mutated model file: loaded, looked over, and run for a moment."""
    pick = random.Random(f"file {seed} {number}")
    raw = mutated_files.mutated(pick, TEXTS)
    integrator = pick.choice(INTEGRATORS)
    path = folder / "case.toml"
    path.write_bytes(raw)
    with observed(folder, lambda place: False) as finding:
        try:
            model = hs.load(path)
            cautions = warnings_of(model)
            str(cautions)
        except hs.ModelError as refusal:
            finding.end = "refused"
            if not str(refusal).strip() or len(str(refusal)) > 20_000:
                finding.faults.append(f"a message of {len(str(refusal))} characters")
            return finding
        finding.end = simulated(model, integrator, finding)
    return finding


def simulated(model: hs.Model, integrator: str, finding: Finding) -> str:
    """How a short run of a model ended."""
    try:
        end = model.duration_value()
        end = 1.0 if end is None else min(end, 1.0)
        sol = hs.simulate(
            model, (0.0, end), integrator=integrator, limits={"seconds": 2, "steps": 5000, "megabytes": 500}
        )
    except hs.HybridsimError as refusal:
        return f"{type(refusal).__name__} on running"
    if not sol.success and not sol.message:
        finding.faults.append(f"status {sol.status} without a message")
    return sol.status


def _is_part_of(place: Path, places: list[Path]) -> bool:
    """Whether a file is what is written beside a place, under a name of its own, and then put there."""
    found = re.fullmatch(r"\.(.+)-[0-9a-f]{16}\.part", place.name)
    return found is not None and place.with_name(found[1]) in places


def line_case(seed: int, number: int, folder: Path) -> Finding:
    """A mutated command line, with a model file and a kept run in the folder."""
    pick = random.Random(f"line {seed} {number}")
    argv = mutated_lines.mutated(pick)
    named = [tail for word in argv for tail in (word, word.partition("=")[2]) if tail and "\0" not in tail]
    # a result is written beside its place and then put there; a folder may have to be made with those above
    parts = [f"{stem}.part{suffix}" for stem, suffix in map(os.path.splitext, named)]
    places = [Path(os.path.abspath(folder / name)) for name in (*named, *parts)]
    defaults = ("compare-", "sweep-", "study-", "atlas")

    def expected(place: Path) -> bool:
        inside = place.relative_to(folder).parts if place.is_relative_to(folder) else ("..",)
        return bool(inside) and (
            inside[0].startswith(defaults)
            or (place.name.startswith(TRIAL) and not place.exists())
            or any(place.is_relative_to(named_place) for named_place in places)
            or (_is_part_of(place, places) and not place.exists())
            or any(
                named_place.is_relative_to(place) and place.is_relative_to(folder) for named_place in places
            )
        )

    out, err = io.StringIO(), io.StringIO()
    with observed(folder, expected) as finding, contextlib.chdir(folder):
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), ctrl_c_after(COMMANDED):
            code = main(argv)
        finding.end = f"exit code {code}"
        if code not in (0, 1, 2, 3, 130):
            finding.faults.append(f"exit code {code}")
        if "Traceback" in err.getvalue() or "internal error" in err.getvalue():
            finding.faults.append(err.getvalue()[-1500:])
        if code in (2, 3) and out.getvalue():
            finding.faults.append(f"exit code {code}, and on stdout: {out.getvalue()[:200]}")
        if code and not err.getvalue():
            finding.faults.append(f"exit code {code} and no message")
        if code == 0 and "--json" in argv and not {"--help", "-h", "--version"} & set(argv):
            with noted(finding.faults, "stdout is no JSON"):
                json.loads(out.getvalue(), parse_constant=lambda word: 1 / 0)
    finding.faults = [f"{fault}\n  of: {' '.join(argv)[:1000]!r}" for fault in finding.faults]
    return finding


@contextlib.contextmanager
def observed(folder: Path, expected: object) -> Iterator[Finding]:
    """A finding that takes up exceptions, warnings, code that ran, and files that nobody asked for."""
    finding = Finding("exception")
    with watching(
        chosen_root() or Path.home(), Path.home() / ".cache", Path.home() / ".config" / "matplotlib"
    ) as seen:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                yield finding
            except Exception:  # whatever was raised is what is looked for: it is the finding
                finding.faults.append(traceback.format_exc()[-3000:])
        finding.faults += [f"{w.category.__name__}: {w.message} ({w.filename}:{w.lineno})" for w in caught]
        finding.faults += seen.code
        written = [place for place in sorted(set(seen.written)) if not is_bytecode(place)]
        finding.faults += [f"wrote {place}" for place in written if not expected(place)]


def is_bytecode(place: Path) -> bool:
    """Whether Python itself keeps the bytecode of a module there, whose source is in the folder above."""
    source = place.parent.parent / f"{place.name.partition('.')[0]}.py"
    return place.parent.name == "__pycache__" and source.is_file()


@contextlib.contextmanager
def noted(faults: list[str], what: str) -> Iterator[None]:
    """An exception of the judge's own questions is a fault."""
    try:
        yield
    except Exception as why:  # of any kind: after a mutation none of these questions may fail
        faults.append(f"{what}: {why}")


@contextlib.contextmanager
def ctrl_c_after(seconds: float) -> Iterator[None]:
    """SIGINT after so long, once, also where whoever started this process had it ignored, as a shell has for `&`.

    From a thread, since a command may use the timers of the process itself.
    """
    previous = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(seconds, os.kill, (os.getpid(), signal.SIGINT))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()
        signal.signal(signal.SIGINT, previous)


@contextlib.contextmanager
def sandbox() -> Iterator[Path]:
    """A folder with what model files and command lines name, inside another, so that `..` is ours as well."""
    with tempfile.TemporaryDirectory() as outer:
        folder = Path(outer) / "here"
        folder.mkdir()
        shutil.copytree(MODELS / "records", folder / "records")
        shutil.copy(MODELS / "belt.toml", folder / "case.toml")
        hs.simulate("dfcs", (0.0, 0.01)).save(folder / "kept.hsol")
        yield folder
