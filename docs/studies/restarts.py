"""Whether a run starts again rightly on and near its guards: a million restarts judged by exact arithmetic.

    python docs/studies/restarts.py [restarts]        (10^6 by default; they make docs/studies/restarts.md)

Three levels. The verdict on a guard just after a restart, from the engine's series and their error bounds, against
the true series of the doubles as given. The search for the first zero after a restart on a zero by decree, against
Sturm's count in integers. And whole runs of a sticking oscillator, some ten releases each, against the closed form.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from reference.dfcs_closed_form import Undecided
from reference.integer_series import BITS
from reference.random_restarts import Searches, Verdicts, friction_restarts, held, searched, smooth_restarts
from reference.releases import KINDS, compare, draw

PAGE = Path(__file__).parents[2] / "docs" / "studies" / "restarts.md"
INTEGRATORS = ("exact", "taylor", "dop853", "tsit5")


# -- whole runs --------------------------------------------------------------------------------------------------

PERIODS = 5


@dataclass
class Runs:
    """Counts over the runs of one integrator."""

    counts: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)


def run_one(tally: Runs, seed: int, number: int, integrator: str) -> None:
    """One run of a random oscillator."""
    rng = np.random.default_rng([seed, 11, number])
    case = draw(rng, KINDS[number % len(KINDS)])
    try:
        found = compare(case, PERIODS, integrator)
    except Undecided:  # the closed form in doubles does not know either
        tally.counts["oracle undecided"] += 1
        return
    tally.counts["runs"] += 1
    tally.counts["restarts"] += found.changes
    tally.counts["releases"] += found.releases
    for name in ("missed", "spurious", "late", "short"):
        tally.counts[name] += getattr(found, name)
    tally.counts["with a warning"] += bool(found.said)
    if not found.is_right:
        tally.faults.append(f"{integrator} {number}: {found} {case}")


# -- the page ----------------------------------------------------------------------------------------------------

HEAD = """# Does a run start again rightly on a guard?

`python docs/studies/restarts.py` makes random restarts on and near guards and holds each against exact
arithmetic on the
doubles as given. The zeros by decree, Z, are declared with each restart ([events](../explanation/events.md)): they
are zero in the oracle too. A restart is *clear* where the first coefficient of the guard's true series that is not
in Z lies beyond twice the engine's own error bound. There the verdict has to be the true one. The others start
*inside the error bound*; they are counted apart and have to follow the stated rule: a coefficient within its bound
counts as zero, the next one is asked, and where none decides the verdict is "undecided at rounding", which keeps
the present mode.

## Verdicts

Series and bounds come from the engine's recurrences, true series from integers of {bits} bits. The expressions are
random (one structure for 500 draws), the state is random, and the guard is moved until it is zero at the state to
the last bit, or 1e-19 to 1 away from it; with three in ten the rate is set to zero likewise. The oscillator is that
of the releases below, over decades of its parameters and up to 10^6 periods out, with the load on the limit of
friction or as near to it.

| restart | judged | clear | spurious | missed | inside, decided | undecided | against the rule | error/bound |
| --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""
SEARCHES = """
*Spurious*: judged to leave and stays; *missed*: the other way. *Inside, decided*: by a higher derivative. The last
column holds the engine's coefficients against the true ones: the bounds are bounds as long as it stays below 1.

## Searches

After the restart, the first zero: random polynomials of up to degree 8 with 0 to 5 zeros, some next to the restart,
some in pairs, whose first 0 to 3 coefficients are zero by decree and hold noise. The oracle is Sturm's count in
integers.

| by decree | searches | stays | leaves | spurious | missed | open | open without reason | start inside |
| --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""
RUNS = """
*Open*: the search says that it comes within its error bound; the general way, which samples the guard, then looks
again. *Start inside*: the leading coefficient is itself within the bound.

## Whole runs

A mass that sticks is released, slips, sticks again: {periods} periods of a random oscillator from a random time,
against the closed form. Four kinds in turn: mu_s = mu_k, mu_s above mu_k, above it by 1e-14 to 1e-2 of it, and
undamped. rtol 1e-8.

| integrator | runs | mode changes | releases | spurious | missed | late | cut short | with a warning |
| --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""
TAIL = """
*Late*: by 1e-5 of a period. *Cut short*: a slip after a release that lasts less than half of what it should, the mark
of a wrong direction.

How to run: `python docs/studies/restarts.py [restarts]`; {minutes:.0f} minutes on one core.
"""


def page(verdicts: Verdicts, searches: Searches, runs: dict[str, Runs], minutes: float) -> str:
    """The page of the results."""
    out = HEAD.format(bits=BITS)
    columns = (
        "restarts",
        "clear",
        "spurious",
        "missed",
        "by a higher derivative",
        "undecided",
        "against the rule",
    )
    for kind in [*sorted({k for k, _ in verdicts.counts}), "all"]:
        kinds = verdicts.widest if kind == "all" else [kind]
        cells = [sum(verdicts.counts[k, column] for k in kinds) for column in columns]
        out += (
            f"| {kind} | "
            + " | ".join(map(str, cells))
            + f" | {max(verdicts.widest[k] for k in kinds):.2f} |\n"
        )
    out += SEARCHES
    columns = ("restarts", "stays", "leaves", "spurious", "missed", "said to be open", "open without reason")
    for d in range(4):
        cells = [searches.counts[d, column] for column in (*columns, "start within the bound")]
        out += f"| {d} | " + " | ".join(map(str, cells)) + " |\n"
    out += RUNS.format(periods=PERIODS)
    columns = ("runs", "restarts", "releases", "spurious", "missed", "late", "short", "with a warning")
    for name, found in runs.items():
        out += f"| `{name}` | " + " | ".join(str(found.counts[column]) for column in columns) + " |\n"
    return out + TAIL.format(minutes=minutes)


def study(count: int, seed: int = 1) -> tuple[Verdicts, Searches, dict[str, Runs]]:
    """Six in ten restarts are verdicts, four in ten searches; for every two hundred, a run by each integrator."""
    began = time.perf_counter()
    verdicts, searches, runs = Verdicts(), Searches(), {name: Runs() for name in INTEGRATORS}
    for restart in islice(smooth_restarts(count, seed), 3 * count // 10):
        held(verdicts, restart)
    for restart in islice(friction_restarts(count, seed), 3 * count // 10):
        held(verdicts, restart)
    print(f"verdicts: {time.perf_counter() - began:.0f} s", flush=True)
    rng = np.random.default_rng([seed, 3])
    for _ in range(4 * count // 10):
        searched(searches, rng)
    print(f"searches: {time.perf_counter() - began:.0f} s", flush=True)
    for name in INTEGRATORS:
        for number in range(count // 200):
            run_one(runs[name], seed, number, name)
        print(f"{name}: {time.perf_counter() - began:.0f} s", flush=True)
    return verdicts, searches, runs


def main() -> None:
    """Run the study, print the tables, write the page."""
    count = int(float(sys.argv[1])) if len(sys.argv) > 1 else 10**6
    began = time.perf_counter()
    verdicts, searches, runs = study(count)
    out = page(verdicts, searches, runs, (time.perf_counter() - began) / 60)
    print(out)
    for faults in (verdicts.faults, searches.faults, *(found.faults for found in runs.values())):
        print("\n".join(faults[:10]))
    if count >= 10**6:
        PAGE.write_text(out)


if __name__ == "__main__":
    main()
