"""Measure the time of a run if the same model runs again with other parameters, another start, or by its name.

    python docs/studies/repeated_runs.py [--turns 40] [--out DIR]

The calls of a scene take turns in one process, with the closed form written by hand. Writes
docs/studies/repeated-runs.md (or DIR). heyoka takes part if it is installed.
"""

from __future__ import annotations

import argparse
import gc
import random
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from rivals import closed_form_two_states
from rivals.page import machine, seconds
from rivals.scenes import scene

import hybridsim as hs

CALLS = 5  # of each kind in a turn


@dataclass(frozen=True)
class Case:
    """A scene, its integrator with options, the parameter that changes, its name, and the largest ratios aimed at."""

    scene: str
    title: str
    options: dict[str, Any]
    parameter: str
    name: str
    aims: dict[str, float]


CASES = (
    Case("P1", "P1 by exact", {"integrator": "exact"}, "F0", "dfcs", {"params": 1.4, "x0": 1.15, "name": 1.2}),
    Case("belt", "belt by taylor", {"integrator": "taylor", "rtol": 1e-12}, "k", "belt",
         {"params": 1.3, "x0": 1.15, "name": 1.2}),
    Case("stribeck", "dfcs-stribeck by dop853", {"integrator": "dop853"}, "F0", "dfcs-stribeck",
         {"params": 1.3, "x0": 1.15, "name": 1.2}),
)  # fmt: skip
TITLES = {"params": "new value in `params`", "x0": "new `x0`", "name": "by name"}


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--turns", type=int, default=40, help="turns of all calls")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="where the page is written")
    options = parser.parse_args()
    found = [measured(case, options.turns) for case in CASES]
    rows = [row for case, times in zip(CASES, found, strict=True) for row in rows_of(case, times)]
    ratios = [times["params"] / times["same"] for times in found]
    (options.out / "repeated-runs.md").write_text(page(rows, ratios))
    print("\n".join(rows))


def measured(case: Case, turns: int) -> dict[str, float]:
    """The median processor time in seconds of a call of each kind."""
    here, draw = scene(case.scene), random.Random(0)
    packaged = hs.load(case.name)
    components = [component.name for component in here.model.all_components()]
    value, x = here.model.parameter_values()[case.parameter], here.model.start_values()["x"]

    def run(model: hs.Model | str, **changes: Any) -> None:
        sol = hs.simulate(model, (0.0, here.end), keep="events", **case.options, **changes)
        for component in components:
            sol.event_times(component)
            sol.event_states(component)

    calls: dict[str, Callable[[], Any]] = {
        "same": lambda: run(here.model),
        "params": lambda: run(here.model, params={case.parameter: value * (1.0 + 1e-7 * draw.random())}),
        "x0": lambda: run(here.model, x0={"x": x + 1e-9 * draw.random()}),
        "packaged": lambda: run(packaged),
        "name": lambda: run(case.name),
    }
    by_hand = closed_form_two_states.method().start(here)
    if by_hand is not None and by_hand.events is not None:
        calls["by hand"] = by_hand.events
    if case.scene == "P1" and (rival := heyoka_of(here)) is not None:
        calls["heyoka"] = rival
    times: dict[str, list[float]] = {kind: [] for kind in calls}
    for turn in range(turns + 2):
        for kind, call in calls.items():
            gc.collect()
            for _ in range(CALLS):
                began = time.process_time()
                call()
                if turn > 1:  # the first two warm up
                    times[kind].append(time.process_time() - began)
    return {kind: median(found) for kind, found in times.items()}


def heyoka_of(here: Any) -> Callable[[], Any] | None:
    """A run by heyoka, which takes the numbers of its parameters from an array, or None if it is not installed."""
    try:
        from rivals import heyoka_taylor
    except ImportError:
        return None
    runs = heyoka_taylor.method(1e-12).start(here)
    return None if runs is None else runs.events


def rows_of(case: Case, found: dict[str, float]) -> list[str]:
    """The lines of a case for the table of the page."""
    same = found["same"]
    rows = [f"| {case.title} | the same call again | {seconds(same)} | 1 | |"]
    for kind, aim in case.aims.items():
        base = found["packaged"] if kind == "name" else same
        ratio = found[kind] / base
        met = "yes" if ratio <= aim else "**no**"
        rows.append(
            f"| {case.title} | {TITLES[kind]} | {seconds(found[kind])} | {ratio:.2f} | at most {aim}: {met} |"
        )
    if "by hand" in found:
        ratio = found["params"] / found["by hand"]
        met = "yes" if ratio <= 3.0 else "**no**"
        rows.append(
            f"| {case.title} | closed form by hand | {seconds(found['by hand'])} | {ratio:.2f} | new value over this, "
            f"at most 3: {met} |"
        )
    if "heyoka" in found:
        ratio = found["heyoka"] / found["params"]
        met = "yes" if ratio >= 4.0 else "**no**"
        rows.append(
            f"| {case.title} | heyoka | {seconds(found['heyoka'])} | {ratio:.2f} | this over new value, at least 4: "
            f"{met} |"
        )
    return rows


def page(rows: list[str], ratios: list[float]) -> str:
    """The page."""
    table = "\n".join(["| run | call | median | ratio | aim |", "| --- | --- | --- | --- | --- |", *rows])
    return f"""# Runs with other numbers

How much longer does a run take if the same model runs again with other numbers? A call with a new value in `params`
takes {min(ratios):.2f} to {max(ratios):.2f} times as long as a call with the old value.

A loop may call `hs.simulate` for one model with many values of a parameter or of the start. hybridsim compiles and
checks the structure of the model only once. For new numbers hybridsim does four things:

- hybridsim repeats the checks that depend on the numbers.
- hybridsim evaluates the parameters that are expressions of other parameters.
- Compiled code determines the modes at the start.
- hybridsim computes the tables of linear modes.

`python docs/studies/repeated_runs.py` writes this page. The table gives medians of processor time. All calls run in
one process, in which the kinds of calls alternate. A call is a run with `keep="events"`, and includes reading the
times and states of all events. Each new value differs from the old value in the eighth digit, so the events do not
change. A call "by name"
passes the name of the model. A call "by name" is compared with a call that passes the `Model` object. {machine()}

{table}

## Repeated preparation

| change | effect |
| --- | --- |
| a number of a parameter | checks that depend on it are repeated, and all else is kept |
| an expression for a parameter | all values are checked, and the code of the structure is kept |
| a number that decides a condition, or makes a coefficient vanish | linear modes are read again, once for each case |
| a start, a discrete state | the start is decided again |
| the file of a model | the model is read again if the time stamp or the size of the file has changed |
| a table in a file of its own | the model is read at every call |
| a Python function | its values are examined at every call |
"""


if __name__ == "__main__":
    main()
