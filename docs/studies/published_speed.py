"""Compare the speed of the published methods with the same methods written by hand for one system.

    python docs/studies/published_speed.py [--turns 31] [--out DIR]

In one process our method and the method by hand take turns at P1 and P2, over 100 periods of 1200 steps. The results
are the times of events and the states at them. Writes docs/studies/published-speed.md (or DIR).
"""

from __future__ import annotations

import argparse
import gc
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median, quantiles
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from rivals import ours, published_rk4
from rivals.method import Method
from rivals.page import machine
from rivals.scenes import Scene, scene

METHODS: tuple[tuple[str, Method, Method], ...] = (
    (
        "`rk4-dichotomy`, v zeroed",
        ours.method("rk4-dichotomy", stick_velocity="zero"),
        published_rk4.dichotomy(),
    ),
    ("`rk4-dichotomy`, v kept", ours.method("rk4-dichotomy"), published_rk4.dichotomy(zeroed=False)),
    ("`rk4-sign`", ours.method("rk4-sign"), published_rk4.sign()),
)
HEAD = """# The published methods at their own speed

How much slower are the published methods in hybridsim than the same methods written by hand for one system?
hybridsim takes {least:.2f} to {most:.2f} times as long as the code written by hand.

`python docs/studies/published_speed.py` compares the integrators `rk4-dichotomy` and `rk4-sign` with code that is
written by hand. hybridsim and this code use the methods of a [published study](he2026.md). The code by hand is for
the system of that study only, and is compiled by numba (`docs/studies/rivals/published_rk4.py`).

- Each run has 100 periods of 1200 steps. In each of {turns} turns, every method runs once. {machine}
- For hybridsim, the time is the processor time of `hs.simulate(..., keep="events")` and of reading the times and
  states of all events. The code written by hand only records events.
- Each turn gives one ratio of two times. The table gives the median of the ratios and, in brackets, the range of the
  middle 90 %.
- If the velocity is set to zero in stick, the code written by hand computes no stages in stick. If the velocity is
  kept, the friction force at every stage equals the applied force, as in Eq. 4 of the paper.
- With `rk4-sign` the sign of the velocity changes in each step in which the body should stick. Rounding affects the
  number of these changes. Therefore hybridsim and the code by hand may find different numbers of events.

| method | scene | events, ours | by hand | median ms, ours | by hand | ratio |
| --- | --- | --- | --- | --- | --- | --- |
"""


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--turns", type=int, default=31, help="turns of each method")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="folder of the page")
    options = parser.parse_args()
    lines = [line for name in ("P1", "P2") for line in _lines(scene(name), options.turns)]
    ratios = [ratio for ratio, _ in lines]
    head = HEAD.format(machine=machine(), turns=options.turns, least=min(ratios), most=max(ratios))
    text = head + "\n".join(line for _, line in lines) + "\n"
    (options.out / "published-speed.md").write_text(text)
    print(text)


def _lines(here: Scene, turns: int) -> list[tuple[float, str]]:
    """Return the median ratio and a line for each method, whose runs take turns."""
    calls: list[Callable[[], Any]] = []
    counts = []
    for method in (method for _, *pair in METHODS for method in pair):
        runs = method.start(here)
        assert runs is not None and runs.events is not None, "all apply to this system"
        calls.append(runs.events)
        counts.append(len(runs.read(runs.events()).t))
    seconds: list[list[float]] = [[] for _ in calls]
    gc.collect()
    gc.disable()
    for _ in range(turns):
        for spent, call in zip(seconds, calls, strict=True):
            began = time.process_time()
            call()
            spent.append(time.process_time() - began)
    gc.enable()
    lines = []
    for k, (label, *_) in enumerate(METHODS):
        first, second = seconds[2 * k], seconds[2 * k + 1]
        ratios = [a / b for a, b in zip(first, second, strict=True)]
        twentieths = quantiles(ratios, n=20)
        line = (
            f"| {label} | {here.name} | {counts[2 * k]} | {counts[2 * k + 1]} | {1e3 * median(first):.2f} | "
            f"{1e3 * median(second):.2f} | {median(ratios):.2f} ({twentieths[0]:.2f} to {twentieths[-1]:.2f}) |"
        )
        lines.append((median(ratios), line))
    return lines


if __name__ == "__main__":
    main()
