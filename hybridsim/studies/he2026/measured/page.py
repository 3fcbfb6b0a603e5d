"""This module writes the page of the study: every claim with its verdict, figure and reason, and further results."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from typing import Any

from hybridsim.studies.he2026.measured.he2026 import Study
from hybridsim.studies.he2026.measured.required_settings import EPS, STEPS
from hybridsim.studies.he2026.measured.settings import SOURCE
from hybridsim.studies.he2026.measured.verdicts import Claim

_PICTURES = {
    "figure 3": "figure-3",
    "figure 4": "figure-4",
    "figure 5": "figure-5",
    "figure 6": "figure-6",
    "figure 7": "figure-7",
    "figures 8, 9": "figures-8-9",
    "figure 10": "figure-10",
    "figure 11": "figure-11",
    "figure 12": "figure-12",
    "figure 13": "figure-13",
    "text": "step-study",
}
_CAPTIONS = {
    "figure 3": "Two periods by every reading, and the exact motion; below, the harmonics of x over the first.",
    "figure 4": "Each line is a case: solid varies r, dashed N, dotted F0; black is a point on the ridge of Figure 10.",
    "figure 5": "As above, over eps_v; the grey line is the published setting.",
    "figure 6": "Left the run time, right the count of right-hand sides, which no machine disturbs.",
    "figure 7": "The grey mark is what +225 % would be.",
    "figures 8, 9": "A line that bends is a method, or a law, for which F0/N and r are not all that matters.",
    "figure 10": "Columns: the published A2 with the velocity of a sticking body kept, set to zero, and the exact A2.",
    "figure 11": "The same for the energy.",
    "figure 12": "Without stick the force jumps between its limits; with v kept the body creeps while it sticks.",
    "figure 13": "Nothing sticks here: all columns are the same.",
    "text": "First order in the step: in the limit nothing is left, since the motion with stick is the limit.",
}
_WIDTH = 120
_PAIR = "Read as: method without stick; reading of the method with stick."


def page(study: Study, image: Callable[[str], str]) -> str:
    """Return the text of the page; `image` is a function that returns the path of a picture."""
    claims = study.claims
    parts = [_head(study, claims)]
    for claim in claims:
        parts.append(_section(claim, image(_PICTURES[claim.name])))
    parts += [
        _readings(study),
        _truth(study, image),
        _required_settings(study, image("needed")),
        _timed_map(study, image("timed-map")),
        _how(study),
    ]
    return "\n\n".join(_wrapped(block) for part in parts for block in part.split("\n\n")) + "\n"


def _wrapped(block: str) -> str:
    """Return a paragraph with its lines wrapped; headings, tables and pictures are unchanged."""
    if block.startswith(("#", "|", "!")):
        return block
    return textwrap.fill(" ".join(block.split()), _WIDTH, break_long_words=False, break_on_hyphens=False)


def _head(study: Study, claims: tuple[Claim, ...]) -> str:
    rows = "\n".join(f"| {c.name} | {c.claim} | **{c.verdict}** |" for c in claims)
    quick = " --quick" if study.size.name == "quick" else ""
    return f"""\
# He et al. 2026, claim by claim

{SOURCE}: when must stick-slip be modelled? Every figure is done again with our implementation of the published
method (`rk4-dichotomy`, and `rk4-sign` for "stick-slip not considered"), in every reading that the paper leaves open,
beside the exact motion (`exact`), and every claim is judged.

**In short.** The paper's motion, its spectrum and its reduction to (r, F0/N) stand. Its map of where stick-slip must be
modelled does not: the equation without stick has the motion with stick as its limit, so that what the map shows is the
size of the step, and it shrinks with it. Its run times are those of one implementation. What holds independent of any
step comes after the claims: where the motion stops, for how long, and how far off models without stops really are.

| figure | claim | verdict |
| --- | --- | --- |
{rows}

**Words.** r = omega/omega_n; A is half the range of x in a period, E the integral of x**2 over it. A0, E0: without
friction; A1, E1: "stick-slip not considered" (`rk4-sign`); A2, E2: considered; A_D = |A1 - A2|/A2, E_D likewise. What
the paper leaves open about the dichotomy, each with its readings: *v kept* or *v zero*, what becomes of the velocity of
a body that has come to stick; *release step* or *located*, whether it breaks away at the next step or where the load
reaches the limit; *force by step* or *by stage*, whether the side of friction is taken once a step or at each of RK4's
stages (*sign by step*, *by stage* for A1); *full-step* or *rest-of-step*, how far it goes on after an event.

One command makes this page, its pictures and the [verdicts as data](he2026.json):
`hybridsim study he2026{quick} --out FOLDER`."""


def _section(claim: Claim, picture: str) -> str:
    title = claim.name[0].upper() + claim.name[1:]
    return "\n".join(
        [
            f"## {title}: {claim.verdict}",
            "",
            f"*The paper:* {claim.claim}.",
            "",
            f"*Here:* {claim.why}",
            "",
            f"![{claim.name}]({picture})",
            "",
            f"*{_CAPTIONS[claim.name]}*",
        ]
    )


def _percent(value: float) -> str:
    return f"{100 * value:.3g} %"


def _readings(study: Study) -> str:
    columns = list(next(iter(study.readings.table.values())))
    rows = []
    for name, row in study.readings.table.items():
        cells = [
            f"{100 * mean:+.2f} ({100 * low:+.2f} to {100 * high:+.2f})" for low, mean, high in row.values()
        ]
        rows.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(
        [
            "## What the paper leaves open",
            "",
            "Amplitude off the exact one in per cent, mean over the last periods of a run (least to greatest). Of the",
            "choices that the text does not settle one matters: whether a sticking body keeps the velocity at which",
            "the dichotomy stopped, as Eq. 4 reads. A motion that does not repeat has a range, not a value.",
            "",
            "| reading | " + " | ".join(columns) + " |",
            "| --- |" + " --- |" * len(columns),
            *rows,
        ]
    )


def _truth(study: Study, image: Callable[[str], str]) -> str:
    facts = study.truth.to_plain()
    within = facts["share of the moving points where a model's amplitude is within 1 %"]
    points = facts["grid"]["points"]
    disagree = facts["points on which the closed form and the exact run disagree whether there are stops"]
    return "\n".join(
        [
            "## What is true, whatever the step",
            "",
            f"The exact steady motion on {points[0]} x {points[1]} points (residual of periodicity: median "
            f"{facts['median residual of periodicity']:.0e}, at most {facts['largest residual of periodicity']:.0e}). "
            "Den Hartog's boundary, a closed form, separates the",
            f"points with stops from those without: {disagree} of them lie on the wrong side, and where it "
            f"says that there",
            "are no stops its amplitude agrees with the run to",
            f"{facts['largest deviation of the closed form where it holds']:.0e}. There are up to",
            f"{facts['most stops per period']} stops a period at low frequency.",
            "",
            f"![stick fraction, stops per period, amplitude]({image('stick')})",
            "",
            "Within 1 % of the exact amplitude, of the moving points: "
            + "; ".join(f"{name} {_percent(share)}" for name, share in within.items())
            + ". The last one needs no simulation at all, and is safe while less than "
            + _percent(facts["stick fraction below which the closed form without stops is within 1 %"])
            + " of the period is spent in stick (5 % off: "
            + _percent(facts["stick fraction below which the closed form without stops is within 5 %"])
            + ").",
            "",
            f"![deviation of simpler models]({image('simpler-models')})",
            "",
            "*Grey: nothing moves, or the model has no answer.*",
        ]
    )


def _required_settings(study: Study, picture: str) -> str:
    facts = study.required_settings.to_plain()
    rows = [
        f"| {name} | {_percent(row['published setting is enough on this share of the map'])} | "
        f"{_percent(row['the finest is not enough on this share'])} |"
        for name, row in facts.items()
        if isinstance(row, dict)
    ]
    return "\n".join(
        [
            "## The setting that is needed for 1 %",
            "",
            f"Started on the exact orbit, every one of the last forty periods within 1 % of its amplitude; "
            f"h0 up to {STEPS[-1]},",
            f"eps_v down to {EPS[-1]:.1e} m/s.",
            "",
            "| method | published setting is enough, share of the map | the finest is not |",
            "| --- | --- | --- |",
            *rows,
            "",
            f"![needed settings]({picture})",
        ]
    )  # fmt: skip


def _timed_map(study: Study, picture: str) -> str:
    facts: dict[str, Any] = study.timed_map.to_plain()
    ratios = facts["time over that of exact"]
    rows = [
        f"| {name} | {1e3 * entry.seconds:.3g} | {entry.points} | {facts[name]['error of A, median']:.1e} | "
        f"{facts[name]['error of A, largest']:.1e} | {facts[name]['error of E, largest']:.1e} | "
        f"{'' if name == 'exact' else f'{ratios[name]:.3g}'} |"
        for name, entry in study.timed_map.entries.items()
    ]
    return "\n".join(
        [
            "## A whole map, timed",
            "",
            f"Steady amplitude and energy on {study.timed_map.side} x {study.timed_map.side} points, "
            f"{facts['settling']}, the same",
            "threads in the same run; all that a point costs is in its time. `exact` runs the whole map, as one",
            "`hs.sweep(..., after=100)`; the others run a random sample of it, point by point, which is a millisecond",
            "of each point's time. Errors are on the sample, against the motion settled to rounding. Shooting is",
            "`hs.steady_state`: it finds the orbit instead of waiting for it, and settles the question of its kind.",
            "",
            "| method | ms a point | points | median error of A | largest of A | largest of E | time, of `exact` = 1 |",
            "| --- | --- | --- | --- | --- | --- | --- |",
            *rows,
            "",
            f"![error against time]({picture})",
        ]
    )


def _how(study: Study) -> str:
    seconds = ", ".join(f"{name} {value:g} s" for name, value in study.seconds.items())
    return "\n".join(
        [
            "## How it was done",
            "",
            f"Size: {study.size.name}; runs of {study.size.periods} periods from rest, A and E over the "
            f"last {study.size.last} of",
            "them: without stick the motion does not repeat, so that one period says little. " + _PAIR,
            f"On {study.workers} threads: {seconds}.",
        ]
    )  # fmt: skip
