"""Measure the shares of parts of the work in the time of a short run, by sampling P1 and the belt.

    python docs/studies/where_time_goes.py [--seconds 20] [--out DIR]

The script needs `perf` (of Linux). A separate process runs the scene repeatedly, with a map of the compiled kernels.
perf samples this process. The samples are added up by the purpose of each function. Writes docs/studies/profile.md (or
DIR).
"""

from __future__ import annotations

import argparse
import gc
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from rivals.page import machine
from rivals.scenes import scene

import hybridsim as hs

ROOT = Path(__file__).parents[2]
SCENES = {"P1": "exact", "belt": "taylor"}
RTOL = 1e-12  # of taylor
FARTHEST = 1 << 16  # bytes of one function, at most
ZEROS, MOTION, MODES = "zeros of guards", "motion and its records", "which mode follows an event"
SERIES, ELEMENTARY = "series of states and guards", "sine, cosine, exponential, logarithm"
MODEL, PYTHON = "functions of the model, other kernels", "Python, NumPy and the memory they take"
PARTS = {
    "first_zero": ZEROS, "earliest_exit": ZEROS, "first_exit": ZEROS, "bernstein": ZEROS,
    "closed_form_loop": MOTION, "taylor_loop": MOTION, "event_loop": MOTION,
    "verdict": MODES, "resolve_event": MODES, "resolve_clear": MODES, "bounds": MODES,
    "series": SERIES, "values": SERIES, "ahead": SERIES, "sizes": SERIES, "advance": SERIES, "expand": SERIES,
}  # fmt: skip


# -- the process that is watched -----------------------------------------------------------------------------------


def run_for_ever(name: str) -> None:
    """Run a scene again and again once the kernels are warm and their map is where perf looks for it."""
    found = _generated()
    here, keywords = scene(name), {"integrator": SCENES[name]}
    if SCENES[name] == "taylor":
        keywords["rtol"] = RTOL  # type: ignore[assignment]  # one is a name, the other a number
    components = [component.name for component in here.model.all_components()]

    def once() -> None:
        sol = hs.simulate(here.model, (0.0, here.end), keep="events", **keywords)  # type: ignore[arg-type]  # as above
        for component in components:
            sol.event_times(component)

    for _ in range(50):
        once()
    places = sorted({**_kernels(), **found}.items())
    ends = [*(address for address, _ in places[1:]), places[-1][0] + FARTHEST]
    with Path(tempfile.gettempdir(), f"perf-{os.getpid()}.map").open("w") as file:
        for (address, title), end in zip(places, ends, strict=True):
            file.write(f"{address:x} {min(end - address, FARTHEST):x} {title}\n")
    print("ready", flush=True)
    while True:
        once()


def _generated() -> dict[int, str]:
    """Machine code that is made for a model, with its names, as it is made."""
    from hybridsim.engine.native import llvm, model_functions

    found: dict[int, str] = {}
    make = llvm.load_or_compile

    def load_or_compile(kept: Path, names: Any, written: Any) -> Any:
        addresses, engine = make(kept, names, written)
        found.update(zip(addresses, (f"generated {name}" for name in names), strict=True))
        return addresses, engine

    llvm.load_or_compile = model_functions.load_or_compile = load_or_compile  # type: ignore[attr-defined, assignment]  # to hear of each
    return found


def _kernels() -> dict[int, str]:
    """Addresses of the compiled kernels, those that were inlined into others left out."""
    from numba.core.registry import CPUDispatcher

    from hybridsim.engine.native import kernels

    found = {address: f"kernel {key[0].__name__}" for key, address in kernels._addresses.items()}
    dispatchers = (o for o in gc.get_objects() if isinstance(o, CPUDispatcher))
    libraries = [compiled.library for kernel in dispatchers for compiled in kernel.overloads.values()]
    libraries += [
        made._library for made in kernels._reached
    ]  # their own code is apart from what is called by C
    for library in libraries:
        for function in library._final_module.functions:
            name = re.search(r"^_ZN9hybridsim.*?\d([a-z_]+)B\d+v", function.name)
            if name and not function.is_declaration:
                found[library.get_pointer_to_function(function.name)] = f"kernel {name[1]}"
    return found


# -- what perf says ------------------------------------------------------------------------------------------------


def samples(name: str, seconds: float) -> Counter[str]:
    """How many samples fall on each part of the work."""
    with tempfile.TemporaryDirectory() as folder:
        # kernels tell their names only in the process that compiled them: they are compiled here once more
        variables = os.environ | {"HYBRIDSIM_CACHE": folder}
        with subprocess.Popen(
            [sys.executable, __file__, "--run", name], stdout=subprocess.PIPE, text=True, env=variables
        ) as watched:
            assert watched.stdout is not None
            if watched.stdout.readline().strip() != "ready":
                raise SystemExit(f"{name} did not get ready")
            data = Path(folder, "perf.data")
            record = [
                "perf",
                "record",
                "-q",
                "-e",
                "cpu-clock",
                "-F",
                "5000",
                "-o",
                str(data),
                "-p",
                str(watched.pid),
            ]
            subprocess.run([*record, "--", "sleep", str(seconds)], check=True)
            script = ["perf", "script", "-i", str(data), "-F", "ip,sym,dso"]
            text = subprocess.run(script, check=True, capture_output=True, text=True).stdout
            watched.kill()
        Path(tempfile.gettempdir(), f"perf-{watched.pid}.map").unlink()
    return Counter(_part(line) for line in text.splitlines() if line.strip())


def _part(line: str) -> str:
    """What one sample belongs to: address, symbol and, in brackets, the file it is in."""
    symbol = line.partition("(")[0].split(maxsplit=1)[-1].strip()
    if "libm" in line.rpartition("(")[2]:
        return ELEMENTARY
    if ".map" in line:
        word = symbol.split()[-1]
        return PARTS.get(word, PARTS.get(word.split("_")[0], MODEL))
    return PYTHON


def page(found: dict[str, Counter[str]]) -> str:
    """The page."""
    names = list(found)
    parts = sorted({part for each in found.values() for part in each}, key=lambda p: -found[names[0]][p])
    rows = []
    for part in parts:
        shares = [100.0 * each[part] / each.total() for each in found.values()]
        rows.append(f"| {part} | " + " | ".join(f"{share:.1f}" for share in shares) + " |")
    head = " | ".join(f"{name} by `{SCENES[name]}`" for name in names)
    return "\n".join(
        [
            "# Profile of two short runs",
            "",
            "Which part of the work takes the most time in a short run?",
            *(
                f"With `{SCENES[name]}` in scene `{name}`, the largest part is *{each.most_common(1)[0][0]}*, with "
                f"{100.0 * each.most_common(1)[0][1] / each.total():.1f} % of the time."
                for name, each in found.items()
            ),
            "",
            "`python docs/studies/where_time_goes.py` runs a scene of [the study of speed](speed.md) repeatedly.",
            "At short intervals the program perf takes a sample, which is the name of the function that is",
            "running. A run is a call of `simulate`, followed by reading the times of all events. The",
            f"tolerance of `taylor` is {RTOL:g}. The table gives the shares of the samples in per cent. {machine()}",
            "",
            f"| part | {head} |",
            "| --- |" + " --- |" * len(names),
            *rows,
            "",
            (
                "*Motion and its records* is the time in the compiled event loop itself, without the "
                "functions of the other rows. *Zeros of guards* is the computation of lower bounds and "
                "Bernstein forms, and the refinement of zeros."
            ),
            "*Which mode follows an event* is the computation of the first derivatives of the guards, with error",
            "bounds, in each candidate mode. If the compiler has inlined a function, its time counts as time of the",
            "caller.",
            "",
        ]
    )


def main() -> None:
    """Run the study."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--seconds", type=float, default=20.0, help="how long to watch each scene")
    options.add_argument("--out", type=Path, default=ROOT / "docs", help="where studies/ is")
    options.add_argument("--run", choices=list(SCENES), help=argparse.SUPPRESS)
    given = options.parse_args()
    if given.run:
        run_for_ever(given.run)
    if shutil.which("perf") is None:
        raise SystemExit(
            "perf is not installed; it is in the package linux-perf, or linux-tools, of a distribution"
        )
    text = page({name: samples(name, given.seconds) for name in SCENES})
    print(text)
    (given.out / "studies").mkdir(parents=True, exist_ok=True)
    (given.out / "studies" / "profile.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
