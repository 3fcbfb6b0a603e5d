"""Compare the zeros of random guards, with up to five zeros and with close pairs, with an oracle.

    python docs/studies/guards.py [guards]            (10^5 by default; they make docs/studies/guards.md)

A model has a guard g(t) and two modes, `up` while g >= 0 and `down` while -g >= 0. It changes its mode at each zero
of g. For `exact` the guard is a random combination of polynomials, exponentials, waves and their products, made of
states and functions of time. For `taylor` it is a product of polynomial or trigonometric factors with known zeros.
One or two of the zeros are a pair or a near miss. There g approaches zero up to a depth of 10^-17 to 10^-1 of its
size, beyond zero or before it. The oracle has g in closed form from the given doubles, and finds its zeros and
depths in 40 digits.
"""

from __future__ import annotations

import math
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

import hybridsim as hs

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from reference.random_guards import FACTORS, LINEAR, SPANS, Draw, linear_draw, product_draw, product_model

PAGE = Path(__file__).parents[2] / "docs" / "studies" / "guards.md"
RTOL = 1e-9  # of the runs by taylor; exact has none
LATE = 1e-9  # of the span: an event further off than this, and than the guard's error explains, is late
ERROR = {"exact": 1e-13, "taylor": 0.1 * RTOL}  # of a guard, relative to its size


# -- judgement ---------------------------------------------------------------------------------------------------


@dataclass
class Tally:
    """Counts over many guards, those of extremes by the decade of depth/size, and what went wrong."""

    guards: int = 0
    zeros: int = 0
    missed: int = 0
    spurious: int = 0
    late: int = 0
    worst_time: float = 0.0
    pairs: Counter[tuple[int, str]] = field(default_factory=Counter)
    misses: Counter[tuple[int, str]] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    deepest_flagged: float = 0.0

    def add(self, other: Tally) -> None:
        """Take another's counts."""
        for name in ("guards", "zeros", "missed", "spurious", "late"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        for name in ("worst_time", "deepest_flagged"):
            setattr(self, name, max(getattr(self, name), getattr(other, name)))
        self.pairs += other.pairs
        self.misses += other.misses
        self.faults += other.faults


def judge(what: str, draw: Draw, span: float, sol: hs.Solution) -> Tally:
    """Compare the events of one run with the truth, and if they differ, with zeros from a finer grid."""
    tally = judged(what, draw, span, sol)
    if tally.faults and draw.closer:
        tally = judged(what, replace(draw, truth=draw.closer()), span, sol)
    return tally


def judged(what: str, draw: Draw, span: float, sol: hs.Solution) -> Tally:
    """Compare the events of one run with given zeros."""
    tally = Tally()
    truth = draw.truth
    events = [e.t for e in sol.events if e.kind == "transition"]
    flags = [e.t for e in sol.events if e.kind == "near-grazing"]
    tally.guards += 1
    silent = False
    known = sorted([z for z, _ in truth.singles] + [e.t for e in truth.extremes])
    for extreme in truth.extremes:
        apart = min((abs(k - extreme.t) for k in known if k != extreme.t), default=span)
        half = 0.5 * (extreme.zeros[1] - extreme.zeros[0]) if extreme.zeros else 0.0
        window = min(3.0 * half + 1e-3 * span, max(0.5 * apart, 1.01 * half))
        near = [t for t in events if abs(t - extreme.t) <= window]
        flagged = any(abs(t - extreme.t) <= window for t in flags)
        events = [t for t in events if abs(t - extreme.t) > window]
        ratio = abs(extreme.depth) / truth.size
        decade = math.floor(math.log10(ratio)) if ratio > 1e-18 else -18
        if extreme.zeros:
            outcome = {2: "found", 0: "flagged" if flagged else "silent"}.get(len(near), "torn")
            tally.pairs[decade, outcome] += 1
            silent = silent or outcome in ("silent", "torn")
            if outcome == "flagged":
                tally.deepest_flagged = max(tally.deepest_flagged, ratio)
            elif outcome == "found":
                # a zero moves by the error of the guard over its slope
                slope = 2.0 * abs(extreme.depth) / max(half, 1e-300)
                allowed = ERROR[sol.integrator] * truth.size / slope if slope > 0 else span
                off = max(abs(t - z) for t, z in zip(sorted(near), extreme.zeros, strict=True))
                tally.late += off > LATE * span + allowed
        else:
            outcome = {0: "flagged" if flagged else "passed"}.get(len(near), "crossed")
            tally.misses[decade, outcome] += 1
    tally.zeros += len(truth.singles)
    left = list(events)
    for zero, slope in truth.singles:
        close = min(left, key=lambda t: abs(t - zero), default=math.inf)
        allowed = 1e-10 * span + 1e-10 * truth.size / max(slope, 1e-300)
        if abs(close - zero) <= 10.0 * allowed:
            left.remove(close)
            tally.late += abs(close - zero) > allowed
            tally.worst_time = max(tally.worst_time, abs(close - zero) * slope / truth.size)
        else:
            tally.missed += 1
    tally.spurious += len(left)
    failed = not sol.success
    if failed or silent or tally.missed or tally.spurious or tally.late:
        tally.faults.append(f"{what}: {draw.params} {draw.start} {draw.truth} -> {sol.status} {sol.events}")
    return tally


def runs(count: int, seed: int) -> Iterator[tuple[str, str, hs.Model, float, Draw]]:
    """Half of them by exact, half by taylor."""
    kinds = list(LINEAR)
    products = [
        (k, pairs, u, product_model(k, pairs, u)) for k in FACTORS for pairs in (1, 2) for u in ("t", "u")
    ]
    for i in range(count // 2):
        rng = np.random.default_rng([seed, i])
        kind = kinds[i % len(kinds)]
        yield "exact", kind, LINEAR[kind], SPANS[kind], linear_draw(kind, rng)
        kind, pairs, u, model = products[i % len(products)]
        yield "taylor", f"{kind} in {u}", model, FACTORS[kind][1], product_draw(kind, pairs, rng)


def study(count: int, seed: int = 1) -> dict[str, Tally]:
    """Run and judge."""
    tallies = {"exact": Tally(), "taylor": Tally()}
    began = time.perf_counter()
    for i, (integrator, kind, model, span, draw) in enumerate(runs(count, seed)):
        options = {"rtol": RTOL} if integrator == "taylor" else {}
        sol = hs.simulate(
            model,
            (0.0, span),
            params=draw.params,
            x0=draw.start,
            z0={"c": "up" if draw.truth.starts_up else "down"},
            integrator=integrator,
            keep="events",
            **options,
        )
        tallies[integrator].add(judge(f"{integrator} {kind} {i}", draw, span, sol))
        if (i + 1) % 20000 == 0:
            print(f"{i + 1} guards, {time.perf_counter() - began:.0f} s", flush=True)
    return tallies


# -- the page ----------------------------------------------------------------------------------------------------

HEAD = """# Is a zero of a guard ever lost?

Does hybridsim ever miss a zero of a guard? Of {zeros} single zeros of {count} random guards, {missed} were missed.
Two zeros may also be so close together that rounding decides whether they exist. The tables below count such pairs.

`python docs/studies/guards.py` draws {count} random guards, half for `exact` and half for `taylor` (rtol
{rtol:.0e}). The script compares every mode change of the runs with an independent solution. The independent solution
uses a closed form of each guard g, with exactly the numbers of the run. The independent solution computes zeros and
distances from zero in 40 digits.

A model has two modes. The guard of one mode is g, and the guard of the other mode is -g. Therefore the mode changes
at each zero of g. After the change, the guard of the new mode starts at zero. The run must not count this zero as
another event.

- For `exact` the guard g is a random sum of terms that linear modes can produce. The guards are polynomials up to
  degree six, sums of two sines, or motions of a damped driven oscillator. Some guards are the sum of two
  exponentials, a sine and t exp(-e t).
- For `taylor` the guard g is a product of factors. Together the factors have up to five zeros. The factors are
  polynomials or trigonometric functions of t or of a state. The product also has two positive factors. One of these
  factors depends on a state with a nonlinear rate.

Most guards have one or two minima or maxima close to zero. The distance of such an extreme value from zero is
called the *depth*. If g turns back after it has passed zero, there is a *pair* of zeros. Two zeros closer than 1 %
of the span count as a pair. If g turns back before it reaches zero, there is a *near miss*.

Depths are relative to the *size* of the guard. For `exact` the size is the largest sum of the absolute values of
the terms. For `taylor` the size is the largest value of the guard. The depths are spread evenly over the decades
from 1e-17 to 1e-1.

## Zeros

| | guards | single zeros | missed | spurious | late | off by at most |
| --- | --- | --- | --- | --- | --- | --- |
"""
PAIRS = """
A zero is *late* if the error of its event time exceeds a limit. For a single zero this limit is the sum of two
parts. The first part is 1e-10 of the span. The second part is 1e-10 of the size divided by the slope of the guard.
For each zero of a pair, the first part of the limit is {late:.0e} of the span. The second part is the effect of an
assumed error of the guard. The assumed error is 1e-13 of the size for `exact`, and a tenth of rtol times the size
for `taylor`.

If the error of a single zero is more than ten times its limit, the zero counts as *missed*. The event of a missed
zero counts as *spurious*. The last column is for single zeros. The largest error of an event time is multiplied by
the slope of the guard, and divided by the size.

## Pairs, by depth over size

A pair is *found* if both zeros are found. A pair is *flagged* if no zero is found, but a near-grazing is reported. A
pair is *lost* if both zeros are missed without a report, or if only one zero is found.

| depth | exact found | flagged | lost | taylor found | flagged | lost |
| --- | --- | --- | --- | --- | --- | --- |
"""
MISSES = """
## Near misses, by depth over size

A near miss is *passed* if there is neither an event nor a report. A near miss is *flagged* if a near-grazing is
reported. A near miss is *crossed* if the run has events, although the guard has no zero.

| depth | exact passed | flagged | crossed | taylor passed | flagged | crossed |
| --- | --- | --- | --- | --- | --- | --- |
"""
TAIL = """
## Error bounds

The deepest pair that was only flagged has a depth of {exact:.1e} of the size for `exact`, and {taylor:.1e} for
`taylor`. The search for zeros in compiled code uses these bounds for the error of the guard:

- For `exact` the bound is (16 + 2 J + 2 w s) 2^-53 of the size. J is the number of modal coordinates, w the largest
  absolute eigenvalue, and s the time since the last event. In this study the bound for `exact` is about 4e-15.
- For `taylor` the bound is 2 (|a_N| + |a_N-1|) + 8 2^-53 sum |a_k|. The a_k are the coefficients of the guard's
  series on the step. This bound is at most 6 rtol = {bound:.0e} of the largest value of the guard.

Every pair whose depth exceeds ten times the bound is found. Every other pair {lost}.

Run `python docs/studies/guards.py [guards]` to repeat the study. The study takes {minutes:.0f} minutes on one core.
"""


def page(count: int, tallies: dict[str, Tally], minutes: float) -> str:
    """The page of the results."""
    zeros, missed = sum(a.zeros for a in tallies.values()), sum(a.missed for a in tallies.values())
    text = HEAD.format(count=count, rtol=RTOL, zeros=zeros, missed=missed)
    for name, a in tallies.items():
        text += f"| `{name}` | {a.guards} | {a.zeros} | {a.missed} | {a.spurious} | {a.late} | {a.worst_time:.0e} |\n"
    text += PAIRS.format(late=LATE)
    text += table(tallies, "pairs", [("found",), ("flagged",), ("silent", "torn")])
    text += MISSES + table(tallies, "misses", [("passed",), ("flagged",), ("crossed", "torn")])
    deepest = {name: a.deepest_flagged for name, a in tallies.items()}
    silent = sum(
        n for a in tallies.values() for (_, fate), n in a.pairs.items() if fate in ("silent", "torn")
    )
    lost = "is found or flagged"
    if silent:
        lost += (
            f", except {silent} that the table counts as lost, below the rounding of the terms of the guard"
        )
    return text + TAIL.format(**deepest, bound=6 * RTOL, minutes=minutes, lost=lost)


def table(tallies: dict[str, Tally], what: str, columns: list[tuple[str, ...]]) -> str:
    """Rows of counts by decade."""
    text = ""
    for decade in range(-18, 0):
        counts = [
            sum(getattr(a, what)[decade, outcome] for outcome in column)
            for a in tallies.values()
            for column in columns
        ]
        if any(counts):
            first = "below 1e-17" if decade == -18 else f"1e{decade} to 1e{decade + 1}"
            text += f"| {first} | " + " | ".join(map(str, counts)) + " |\n"
    return text


def main() -> None:
    """Run the study, print the table, write the page."""
    count = int(float(sys.argv[1])) if len(sys.argv) > 1 else 10**5
    began = time.perf_counter()
    tallies = study(count)
    text = page(count, tallies, (time.perf_counter() - began) / 60)
    print(text)
    for a in tallies.values():
        print("\n".join(a.faults[:20]))
    if count >= 10**5:
        PAGE.write_text(text)


if __name__ == "__main__":
    main()
