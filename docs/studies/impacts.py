"""Compute the energy of impacts of random mechanisms, with several contacts at once, restitution and friction.

    python docs/studies/impacts.py [impacts]    (100000 by default)

Writes docs/studies/impacts.md.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from reference.random_impact_problems import random_impact_problem

from hybridsim.engine.events.jumps.impulse import answers

PAGE = Path(__file__).parents[2] / "docs" / "studies" / "impacts.md"
SHAPES = ((1, 0), (2, 0), (3, 0), (1, 1), (2, 1), (2, 2), (3, 2))  # normal contacts, and those with friction


def examine(normal: int, tangential: int, count: int) -> tuple[Counter[str], float, float]:
    """How impacts ended; the largest gain of energy, and the median loss, over the energy of the change."""
    rng = np.random.default_rng((normal, tangential))
    ends: Counter[str] = Counter()
    gains = []
    sign = np.where(np.arange(normal + tangential) < normal, 1.0, -1.0)
    for _ in range(count):
        blow = random_impact_problem(rng, normal, tangential)
        found = answers(blow)
        if len(found) != 1:
            ends["several" if found else "none"] += 1
            continue
        ends["less" if found[0].reduced else "one"] += 1
        p = sign * found[0].impulses
        change = p @ (blow.effects * sign) @ p / 2
        if change > 0.0:
            gains.append(float(p @ (blow.before + found[0].after) / 2 / change))
    return ends, max(gains), -float(np.median(gains))


def main(total: int) -> None:
    """Run all shapes and write the page."""
    rows, count, most = [], 0, -1.0
    for normal, tangential in SHAPES:
        ends, gain, loss = examine(normal, tangential, total // len(SHAPES) + 1)
        count, most = count + sum(ends.values()), max(most, gain)
        rows.append(
            f"| {normal} | {tangential} | {sum(ends.values())} | {ends['less']} | {ends['several']} | "
            f"{ends['none']} | {gain:.1e} | {loss:.2f} |"
        )
        print(rows[-1], flush=True)
    PAGE.write_text(TEXT.format(rows="\n".join(rows), count=count, most=most), encoding="utf-8")


TEXT = """# Do impacts gain energy?

Does an impact ever add energy? Of {count} random impacts, no impact with a single outcome adds energy beyond
rounding.

`docs/studies/impacts.py` draws random mechanisms of up to 7 coordinates with dense mass matrices. An impact has up
to 3 gaps. At the instant of the impact each gap either closes, or is already closed. The coefficient of restitution
of each gap is between 0 and 1. Up to 2 gaps also have friction, with a coefficient between 0 and 1.

Let P be the impulses. Let u- and u+ be the relative velocities at the contacts before and after the impact. The
change of kinetic energy is P.(u- + u+)/2. The table gives the change of kinetic energy relative to P.G P/2, which is
the kinetic energy of the change of velocities. The matrix G is defined by u+ - u- = G P. A gain is a positive
change, and a loss is a negative change.

| gaps | with friction | impacts | rebound reduced | several outcomes | none | largest gain | median loss |
| --- | --- | --- | --- | --- | --- | --- | --- |
{rows}

Rounding errors grow with the condition number of G, which is at most 1e4 here. The column "rebound reduced" counts
impacts in which Newton's law of restitution would add energy (Kane's paradox). In such impacts hybridsim reduces the
rebound, and the run has a warning. An impact with friction may have several outcomes or no outcome. The run then
ends with the status `nonunique` or `inconsistent`. See [impacts](../explanation/events.md#impacts).
"""


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
