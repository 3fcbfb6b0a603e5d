"""Compare stopped and resumed runs with undisturbed ones, and count the points that a killed sweep loses.

    python docs/studies/survival.py [--moments N] [--kills N] [--seed S]      (100 and 50 make
    docs/studies/survival.md)

The runs use every integrator that is compiled or has a fixed step. The scenes have stick and slip, impacts that come
to rest, clocks and discrete states, jumps of an input, sliding, and friction along a stop. A run is stopped at a
random step and resumed. Its times, states, events with both their sides, and status are compared with a run that was
never stopped. A sweep in a child process is ended by SIGKILL at random moments until it is complete.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import hybridsim as hs

PAGE = Path(__file__).parents[2] / "docs" / "studies" / "survival.md"
_SCENES = Path(hs.__file__).parent / "testing" / "scenes"
# the others are models of the package
FILES = {name: str(_SCENES / f"{name}.toml") for name in ("bar", "rubbing-stop")}
# Ends of the runs. A compiled loop looks at its limits between stretches of a thousand segments or of some thousand
# fixed steps, so that a run has to be several of them long to be stopped at all.
SCENES = {
    "dfcs": 0.05,
    "square-wave": 2.0,
    "sampled-servo": 0.05,
    "relay-pair": 3.0,
    "bouncing-ball": 3.0,
    "vibrating-table": 0.15,
    "bar": 2.0,
    "thrown-block": 2.0,
    "rubbing-stop": 5.0,
}
LONGER = {
    **{(name, "dfcs"): 20.0 for name in ("exact", "taylor", "dop853", "tsit5")},
    **{
        (name, scene): end
        for name in ("rk4-dichotomy", "rk4-sign", "moreau")
        for scene, end in {
            "dfcs": 1.0,
            "square-wave": 24.0,
            "sampled-servo": 0.2,
            "bouncing-ball": 30.0,
            "vibrating-table": 20.0,
            "bar": 20.0,
            "thrown-block": 20.0,
            "rubbing-stop": 20.0,
        }.items()
    },
}
# Nothing in these has a period, of which a fixed step would be a share.
STEPS = dict.fromkeys(("sampled-servo", "bouncing-ball", "bar", "thrown-block", "rubbing-stop"), 1e-3)
INTEGRATORS = ("exact", "taylor", "dop853", "tsit5", "rodas5p", "rk4-dichotomy", "rk4-sign", "moreau")
FIXED = ("rk4-dichotomy", "rk4-sign", "moreau")
FORCES, SPEEDS = 40, 25  # points of the sweep that is killed, by its two parameters


# -- resume ------------------------------------------------------------------------------------------------------


def difference(one: hs.Solution, other: hs.Solution) -> str:
    """The differences between two solutions in the last bit, empty if there are none."""
    if (one.status, one.message, len(one.events)) != (other.status, other.message, len(other.events)):
        return f"{one.status} with {len(one.events)} events, {other.status} with {len(other.events)}"
    for a, b in zip(one.events, other.events, strict=True):
        same = (a.t, a.kind, a.component, a.guard, a.source, a.target, a.direction) == (
            b.t, b.kind, b.component, b.guard, b.source, b.target, b.direction,
        )  # fmt: skip
        if not same or a.x_minus.tobytes() != b.x_minus.tobytes() or a.x_plus.tobytes() != b.x_plus.tobytes():
            return f"{a!r} and {b!r}"
    return (
        "" if (one.t.tobytes(), one.y.tobytes()) == (other.t.tobytes(), other.y.tobytes()) else "the states"
    )


def resumed(
    scene: str, integrator: str, moments: int, draws: np.random.Generator
) -> tuple[int, int, list[str]]:
    """Moments at which a run was stopped, those at which it was already done, and the differences."""
    model, span = (
        hs.load(FILES.get(scene, scene)),
        (0.0, LONGER.get((integrator, scene), SCENES[scene])),
    )
    given = {"step": STEPS[scene]} if integrator in FIXED and scene in STEPS else {}
    whole = hs.simulate(model, span, integrator=integrator, **given)
    most, stopped, done, faults = max(int(whole.stats["steps"]), 2), 0, 0, []
    began = time.perf_counter()
    for _ in range(moments):
        steps = int(draws.integers(1, most))
        part = hs.simulate(model, span, integrator=integrator, limits={"steps": steps}, **given)
        if part.status == "limit":
            stopped += 1
            part = part.resume()
        else:
            done += 1
        if fault := difference(whole, part):
            faults.append(f"{scene} with {integrator} after {steps} steps: {fault}")
    print(
        f"{integrator} {scene}: {most} steps, {stopped} stopped, {time.perf_counter() - began:.1f} s",
        flush=True,
    )
    return stopped, done, faults


def resume_rows(moments: int, seed: int) -> tuple[list[str], list[str]]:
    """The rows of the table, and what differed."""
    rows, faults = [], []
    for integrator in INTEGRATORS:
        cells, draws = [], np.random.default_rng(seed)
        for scene in SCENES:
            try:
                stopped, done, found = resumed(scene, integrator, moments, draws)
            except hs.UsageError:
                cells.append("refused")
                continue
            cells.append(f"{stopped}" + (f" (+ {done} done)" if done else ""))
            faults += found
        rows.append(f"| `{integrator}` | " + " | ".join(cells) + " |")
        print(rows[-1], *faults[-3:], sep="\n", flush=True)
    return rows, faults


# -- kills -------------------------------------------------------------------------------------------------------


def point(model: hs.Model) -> dict[str, float]:
    """The measurement at a point, which is logged before it begins."""
    values = model.parameter_values()
    log = os.environ.get("SURVIVAL_LOG")
    if log:
        with open(log, "a", encoding="utf-8") as file:
            file.write(f"{values['F0']!r} {values['omega']!r}\n")
    sol = hs.simulate(model, (0.0, 0.6), integrator="dop853")
    return {"x": float(sol.y[0, -1]), "v": float(sol.y[1, -1]), "events": float(len(sol.events))}


def swept(journal: Path | None) -> hs.Sweep:
    """The sweep."""
    values = {
        "F0": np.linspace(20.0, 40.0, FORCES).tolist(),
        "omega": np.linspace(300.0, 500.0, SPEEDS).tolist(),
    }
    return hs.sweep("dfcs", values, point, journal=journal, workers=1)


def killed(kills: int, seed: int, folder: Path) -> dict[str, float | bool]:
    """A sweep ended by so many SIGKILLs at random moments, compared with an undisturbed one."""
    draws = np.random.default_rng(seed)
    journal, log = folder / "sweep.journal", folder / "log"
    point(hs.load("dfcs"))  # so that all is compiled
    began = time.perf_counter()
    whole = swept(None)
    usual = time.perf_counter() - began
    environment = os.environ | {"SURVIVAL_LOG": str(log)}
    dealt = begun_anew = most_lost = 0
    lost: list[int] = []
    while dealt < kills:
        known = entries(journal)
        tried = count_lines(log)
        child = subprocess.Popen([sys.executable, __file__, "--child", str(journal)], env=environment)
        # a share of what is left, counted from the moment at which it works
        while count_lines(log) == tried and child.poll() is None:
            time.sleep(0.001)
        time.sleep(float(draws.uniform(0.0, 2.0 * usual / kills)))
        if child.poll() is not None:
            begun_anew += 1  # all was done, so the sweep begins again
            journal.unlink(missing_ok=True)
            log.unlink(missing_ok=True)
            continue
        child.send_signal(signal.SIGKILL)
        child.wait()
        dealt += 1
        tried_now, kept_now = count_lines(log) - tried, entries(journal) - known
        lost.append(tried_now - kept_now)
        most_lost = max(most_lost, lost[-1])
    again = swept(journal)
    same = all(
        v.tobytes() == again[name].tobytes() and v.dtype == again[name].dtype
        for name, v in whole.values.items()
    )
    return {
        "same": bool(same and (whole.status == again.status).all()),
        "points": FORCES * SPEEDS,
        "kills": dealt,
        "begun": begun_anew,
        "lost": sum(lost),
        "most": most_lost,
        "seconds": usual,
    }


def count_lines(path: Path) -> int:
    """Lines of a file, 0 if it does not exist."""
    return path.read_bytes().count(b"\n") if path.exists() else 0


def entries(journal: Path) -> int:
    """Points whose results a journal holds; its last line may be cut."""
    if not journal.exists():
        return 0
    whole = [line for line in journal.read_bytes().splitlines(keepends=True)[1:] if line.endswith(b"\n")]
    return sum(len(json.loads(line)[0]) for line in whole)


# -- the page ----------------------------------------------------------------------------------------------------

TEXT = """# Runs that are stopped, sweeps that are killed

Does a run or a sweep survive an interruption? {verdict} A resumed sweep gives the results of an uninterrupted sweep.
After each kill the sweep computes at most {most} point a second time. The script `docs/studies/survival.py`
interrupts runs and sweeps.

## Stopped at a random step and resumed

Each run was stopped at {moments} random steps by `limits={{"steps": ...}}` and continued by `resume()`. The table
counts the runs that stopped. Compiled code checks limits only at certain times. If a run reached its end before the
next check, it is *done*. Resumed runs are compared bit for bit with a run that was never stopped. The comparison
includes the times and states of all steps, the status and the message. The comparison also includes the events, with
the states before and after them.

| integrator | {scenes} |
| --- | {lines} |
{rows}

*Refused* means that the method reports a missing capability.

## Killed

A sweep of {points} points runs in a separate process. Without interruption the sweep took {seconds:.1f} s. SIGKILL
ended the process {kills} times at random times. Each time the sweep was started again. In {begun} cases the sweep
finished before the kill. After such a finish the sweep started again without a journal. The process writes each
point to a log file before it computes the point.

| | |
| --- | --- |
| results equal to those of an undisturbed sweep, to the last bit | {same} |
| points whose computation was begun more than once, over all kills | {lost} |
| points begun again after one kill, at most | {most} |

A sweep writes its journal after each group of points. A kill therefore loses the results of the current group. The
sweep of this study has one worker.
"""


def main() -> None:
    """Run both and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--moments", type=int, default=100)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.child:
        swept(args.child)
        return
    with tempfile.TemporaryDirectory() as folder:
        deaths = killed(args.kills, args.seed, Path(folder))
    print(deaths, flush=True)
    rows, faults = resume_rows(args.moments, args.seed)
    print(*faults, f"{len(faults)} differ", sep="\n")
    if args.moments >= 100 and args.kills >= 50:
        verdict = (
            f"{len(faults)} of the resumed runs differ."
            if faults
            else "No resumed run differs from an uninterrupted run."
        )
        words = deaths | {"same": "yes" if deaths["same"] else "no"}
        PAGE.write_text(
            TEXT.format(
                moments=args.moments,
                scenes=" | ".join(f"`{s}`" for s in SCENES),
                lines=" | ".join("---" for _ in SCENES),
                rows="\n".join(rows),
                verdict=verdict,
                **words,
            ),
            encoding="utf-8",
        )


if __name__ == "__main__":
    main()
