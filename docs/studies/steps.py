"""Compare random sequences of calls of a simulator with single runs that have knots at the same times.

    python docs/studies/steps.py [sequences]        (1000 by default; they make the table in docs/studies/steps.md)

Each sequence mixes start, advance, set, save, restore, copy and pickle, on a pulled block, a linear oscillator and a
pendulum, each with dry friction and a held force. The straight run is that of the same model with a discrete force
that schedules set, and its compiled calls end at these times: tables of `exact` are made for the longest call.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from simulator.random_steps import KINDS, compare

PAGE = Path(__file__).with_suffix(".md")
BEGIN = "| model | integrator |"


def main(count: int) -> None:
    """Compare `count` sequences and write the table."""
    cases = [(k, i) for k in KINDS for i in ("exact", "taylor", "dop853") if (k, i) != ("pendulum", "exact")]
    rows = [
        f"{BEGIN} sequences | calls | equal bit for bit | same modes | largest difference |",
        "|" + " --- |" * 7,
    ]
    for n, (kind, integrator) in enumerate(cases):
        began, seeds = time.perf_counter(), range(n, count, len(cases))
        found = [compare(kind, integrator, seed) for seed in seeds]
        equal, same = sum(o.is_equal for o in found), sum(o.has_same_modes for o in found)
        worst, calls = max(o.difference for o in found), sum(o.calls for o in found)
        rows.append(f"| {kind} | {integrator} | {len(seeds)} | {calls} | {equal} | {same} | {worst:.1g} |")
        print(rows[-1], f"{time.perf_counter() - began:.0f} s", flush=True)
    text = PAGE.read_text(encoding="utf-8")
    head, rest = text.split("<!-- table -->\n")[0], text.split("<!-- end -->\n")[1]
    PAGE.write_text(
        f"{head}<!-- table -->\n\n" + "\n".join(rows) + f"\n\n<!-- end -->\n{rest}", encoding="utf-8"
    )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
