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
    "figure 10": "figure-10",
    "figure 11": "figure-11",
    "figure 12": "figure-12",
    "figure 13": "figure-13",
    "text": "step-study",
}
_CAPTIONS = {
    "figure 3": "Two periods by every reading and by the exact motion, and below the harmonics of x over the first.",
    "figure 4": "Each line is a case. Solid lines vary r, dashed N, dotted F0. Black is a point "
    "on the ridge of Figure 10.",
    "figure 5": "The same over eps_v. The grey line is the published setting.",
    "figure 6": "Left is the run time. Right is the number of evaluations, which no other program disturbs.",
    "figure 7": "The grey mark is +225 %.",
    "figure 10": "The columns have the published A2 with the velocity of a sticking body kept, "
    "set to zero, and the exact A2.",
    "figure 11": "The same for the energy.",
    "figure 12": "Without stick the force jumps between its limits. With v kept the body creeps while it sticks.",
    "figure 13": "Nothing sticks here, so that all columns are equal.",
    "text": "The deviation is of first order in the step. It vanishes in the limit, since "
    "the limit is the motion with stick.",
}
_WIDTH = 120
_PAIR = "Each pair names the method without stick, and then the reading of the method with stick."


def page(study: Study, image: Callable[[str], str]) -> str:
    """Return the text of the page; `image` is a function that returns the path of a picture."""
    claims = study.claims
    parts = [_head(study, claims)]
    for claim in claims:
        parts.append(_section(claim, image))
    parts += [
        _readings(study),
        _truth(study, image),
        _required_settings(study, image("needed")),
        _timed_map(study, image("timed-map")),
        _how(study),
    ]
    return "\n\n".join(_wrapped(block) for part in parts for block in part.split("\n\n")) + "\n"


def _wrapped(block: str) -> str:
    """Return a paragraph with its lines wrapped; headings, tables, lists and pictures are unchanged."""
    if block.startswith(("#", "|", "!", "- ")):
        return block
    return textwrap.fill(" ".join(block.split()), _WIDTH, break_long_words=False, break_on_hyphens=False)


def _head(study: Study, claims: tuple[Claim, ...]) -> str:
    rows = "\n".join(f"| {c.name} | {c.claim} | **{c.verdict}** |" for c in claims)
    quick = " --quick" if study.size.name == "quick" else ""
    return f"""\
# He et al. 2026, claim by claim

When must a model include stick-slip? The published map does not answer this question, because it shows the size of
the step ({SOURCE}). The equation without stick has the motion with stick as its limit, so that the values of the map
decrease with the step. The motion, the spectrum and the reduction to (r, F0/N) in the paper are right. Its run times
are those of one implementation.

This study computes every figure again with our implementation of the published method (`rk4-dichotomy`, and
`rk4-sign` for "stick-slip not considered"). It uses every reading that the paper leaves open, and compares them with
the exact motion (`exact`). Results that hold for any step are after the claims. They show which motions stop, for
how long, and how large the errors of models without stops really are.

| figure | claim | verdict |
| --- | --- | --- |
{rows}

**Terms.** r is omega/omega_n. A is half the range of x in a period, and E is the integral of x**2 over it. A0 and E0
are without friction. A1 and E1 are with "stick-slip not considered" (`rk4-sign`), and A2 and E2 with stick-slip
considered. A_D is
|A1 - A2|/A2, and E_D is defined in the same way. The paper leaves these details of the dichotomy open:

- *v kept* or *v zero* is the velocity of a body after it has stopped.
- *release step* or *located* is the time of the release. It is at the next step, or when the load reaches the limit.
- *force by step* or *by stage* is the side of friction. It is chosen once per step, or at each stage of RK4. For A1
  these are *sign by step* and *by stage*.
- *full-step* or *rest-of-step* is the length of the step after an event.

One command makes this page, its pictures and the [verdicts as data](he2026.json):
`hybridsim study he2026{quick} --out FOLDER`."""


def _section(claim: Claim, image: Callable[[str], str]) -> str:
    title = claim.name[0].upper() + claim.name[1:]
    lines = [
        f"## {title}: {claim.verdict}",
        "",
        f"The paper claims that {claim.claim}.",
        "",
        f"**Result.** {claim.why}",
    ]
    if claim.name in _PICTURES:
        picture = f"![{claim.name}]({image(_PICTURES[claim.name])})"
        lines += ["", picture, "", f"*{_CAPTIONS[claim.name]}*"]
    return "\n".join(lines)


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
            "## Details that the paper leaves open",
            "",
            "The table gives the error of the amplitude in per cent. It is the mean over the last",
            "periods of a run (least",
            "to greatest). One of the open details matters. It is the velocity of a sticking body, which",
            "Eq. 4 keeps at its",
            "value after the dichotomy. If the motion does not repeat, the amplitude is a range.",
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
            "## Results that hold for any step",
            "",
            f"The exact steady motion was computed on {points[0]} x {points[1]} points. The residual of periodicity is "
            f"{facts['median residual of periodicity']:.0e} (median), and at most "
            f"{facts['largest residual of periodicity']:.0e}. Den Hartog's boundary is a closed form that separates",
            f"the points with stops from those without. {disagree} points are on the wrong side. If there",
            "are no stops,",
            "the closed form of the amplitude agrees with the run to",
            f"{facts['largest deviation of the closed form where it holds']:.0e}. There are up to",
            f"{facts['most stops per period']} stops per period at low frequency.",
            "",
            f"![stick fraction, stops per period, amplitude]({image('stick')})",
            "",
            "The simpler models are within 1 % of the exact amplitude on these shares of the moving points: "
            + ", ".join(f"{name} {_percent(share)}" for name, share in within.items())
            + ". The last model needs no simulation. Its error is below 1 % if less than "
            + _percent(facts["stick fraction below which the closed form without stops is within 1 %"])
            + " of the period is stick, and below 5 % if less than "
            + _percent(facts["stick fraction below which the closed form without stops is within 5 %"])
            + " is stick.",
            "",
            f"![deviation of simpler models]({image('simpler-models')})",
            "",
            "*Grey points do not move, or the model has no answer.*",
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
            "## Settings for an error of 1 %",
            "",
            "The runs start on the exact orbit. A setting is enough if each of the last forty periods is within 1 % of",
            f"the exact amplitude. h0 is up to {STEPS[-1]}, and eps_v down to {EPS[-1]:.1e} m/s.",
            "",
            "| method | share of the map with enough at the published setting | share without enough at the finest |",
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
            "## Run time of a whole map",
            "",
            f"The map has the steady amplitude and energy on {study.timed_map.side} x "
            f"{study.timed_map.side} points, from "
            f"{facts['settling']}. All methods use the same",
            "threads in the same run, and the time includes all costs of a point. `exact` runs the whole map as one",
            "`hs.sweep(..., after=100)`. The others run a random sample of it, point by point, which",
            "adds a millisecond",
            "per point. Errors are those of the sample, compared with the motion that has settled to",
            "rounding. Shooting",
            "is `hs.steady_state`, which finds the orbit without a long run and also determines its kind.",
            "",
            "| method | ms per point | points | median error of A | largest of A | of E | time, `exact` = 1 |",
            "| --- | --- | --- | --- | --- | --- | --- |",
            *rows,
            "",
            f"![error against time]({picture})",
        ]
    )


def _how(study: Study) -> str:
    return "\n".join(
        [
            "## Size of the study",
            "",
            f"The size is {study.size.name}. Runs have {study.size.periods} periods from rest, and A and E are",
            f"those of the last {study.size.last} of them. Without stick the motion does not repeat, so that one",
            f"period is not enough. {_PAIR} The study ran on {study.workers} threads.",
            "",
            "| part | seconds |",
            "| --- | --- |",
            *(f"| {name} | {value:g} |" for name, value in study.seconds.items()),
        ]
    )
