"""Compare a million restarts on and near guards with exact arithmetic.

    python docs/studies/restarts.py [restarts]        (10^6 by default; they make docs/studies/restarts.md)

There are three levels. The verdict on a guard just after a restart follows from the series of the engine and their
error bounds. It is compared with the true series of the given doubles. The search for the first zero after a restart
on a zero by definition is compared with Sturm's count in integers. Whole runs of a sticking oscillator, with about
ten releases each, are compared with the closed form.
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

HEAD = """# Restarts on a guard

Does a run start correctly on a guard after an event? Of {clear} restarts that rounding does not decide, {spurious}
had a spurious event, and {missed} missed an event.

After an event a new segment of the run starts, often at a state at which a guard is zero. hybridsim then decides
whether this guard fires. The script `python docs/studies/restarts.py` makes random restarts on guards and near
guards. An independent computation in exact arithmetic, called the oracle, decides each restart for the same numbers.
In most restarts some quantities are zero by definition ([events](../explanation/events.md)). Quantities that are
zero by definition are zero in the oracle too.

hybridsim computes the Taylor series of the guard, with an error bound for each coefficient. Coefficients that are
zero by definition are skipped, and the next coefficient decides. A restart is *clear* if the true value of the
deciding coefficient is more than twice its error bound. For a clear restart the verdict of hybridsim must be the
true verdict. All other restarts are *inside the error bound*, and follow another rule. In these restarts a
coefficient within its bound counts as zero, and the next coefficient decides. If no coefficient decides, the verdict
is "undecided", and the mode does not change.

## Verdicts

The oracle computes the true series with integers of {bits} bits. In the rows "expression" the guard is a random
expression at a random state. Each expression is used for 500 sets of numbers. A constant is added to the guard. The
value of the guard is then zero to the last bit, or differs from zero by 1e-19 to 1. In three of ten restarts a
constant is also added to the rate of the guard.

The other rows are for guards of the oscillator that is described under "Whole runs". The parameters of this
oscillator vary over decades. The restart is up to 10^6 periods after the start. The applied force is at the limit of
friction or very near to it.

| restart | judged | clear | spurious | missed | inside, decided | undecided | against the rule | error/bound |
| --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""
SEARCHES = """
A restart is *spurious* if only hybridsim finds that the guard fires. A restart is *missed* if only the oracle finds
that the guard fires. *Inside, decided* means that the first coefficient is within its bound, so that a higher
derivative decides. The last column is the largest error of a computed coefficient, divided by its bound. The bounds
are valid if this quotient is below 1.

## Searches

A search finds the first zero of a function after the restart. The functions are random polynomials of up to degree
8 with 0 to 5 zeros. Some zeros are very near to the restart, and some zeros form close pairs. The first 0 to 3
coefficients are zero by definition, but the computed coefficients contain small random errors. The oracle counts
zeros by Sturm's method in integers. The columns "stays" and "leaves" count searches without and with a zero.

| zero by definition | searches | stays | leaves | spurious | missed | open | open without reason | start inside |
| --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""
RUNS = """
A search is *open* if, at some time, the computed function is smaller than its error bound. The function may then be
zero at this time. After an open search, another method searches again by sampling the guard. *Start inside* means
that the leading coefficient at the start is within its bound.

## Whole runs

A run lasts {periods} periods of a random forced oscillator with friction, at rtol 1e-8. The run begins at a random
time. The mass sticks, is released, slips, and sticks again. Each run is compared with a closed form. There are four
kinds of oscillators. In oscillators of the first kind, mu_s equals mu_k. In the second kind, mu_s is greater than
mu_k. In the third kind, mu_s exceeds mu_k by only a relative 1e-14 to 1e-2. The fourth kind has no damping.

| integrator | runs | mode changes | releases | spurious | missed | late | cut short | with a warning |
| --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""
TAIL = """
An event is *late* if its error exceeds 1e-5 of a period. A slip after a release is *cut short* if it lasts less
than half of its true duration. A possible cause is a wrong direction of slip.

Run `python docs/studies/restarts.py [restarts]` to repeat the study. The study takes {minutes:.0f} minutes on one
core.
"""


def page(verdicts: Verdicts, searches: Searches, runs: dict[str, Runs], minutes: float) -> str:
    """The page of the results."""
    all_of = {
        column: sum(verdicts.counts[kind, column] for kind in verdicts.widest)
        for column in ("clear", "spurious", "missed")
    }
    out = HEAD.format(bits=BITS, **all_of)
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
