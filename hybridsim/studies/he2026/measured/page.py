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
    "figure 3": "The upper panels show two periods of each reading and of the exact motion. The lower panels show"
    " the harmonics of x relative to the first harmonic.",
    "figure 4": "Each line is a case. Solid lines are for different r, dashed lines for different N, and dotted "
    "lines for different F0. The black line is for a point on the ridge of Figure 10.",
    "figure 5": "The curves are the results of these cases over eps_v. The grey line is the published setting.",
    "figure 6": "The left panel shows the run time. The right panel shows the number of evaluations, which other "
    "programs on the machine do not change.",
    "figure 7": "The grey mark shows the claim of +225 %.",
    "figure 10": "The first two columns are for the published A2, with the velocity in stick kept and set to "
    "zero. The last column is for the exact A2.",
    "figure 11": "These are the maps of Figure 10 for the energy.",
    "figure 12": "Without stick the force jumps between its limits. With v kept the body creeps in stick.",
    "figure 13": "The body does not stick in this case, so all columns are equal.",
    "text": "The deviation is of first order in the step. It tends to zero with the step, because the computed "
    "motion tends to the motion with stick.",
}
_WIDTH = 120
_PAIR = (
    "In each pair of methods, the first is the method without stick. The second is the reading of the "
    "method with stick."
)


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

When must a model include stick-slip? The map in the paper does not answer this question, because its values depend
on the size of the step ({SOURCE}). For small steps, the motion that is computed without stick approaches the motion
with stick. The values of the map therefore decrease with the step. The motion, the spectrum and the reduction to
(r, F0/N) in the paper are right. The run times in the paper are those of one implementation.

This study computes every figure again with our implementation of the published method. It consists of
`rk4-dichotomy`, and of `rk4-sign` for "stick-slip not considered". The paper leaves details of the method open. The
study runs the method with each choice of these details, called a reading, and compares the results with the exact
motion (`exact`). The sections after the claims give results that do not depend on a step. They show which motions
stop, for how long, and how large the errors of models without stops are.

| figure | claim | verdict |
| --- | --- | --- |
{rows}

**Terms.** r is the frequency ratio omega/omega_n. A is half the range of x in a period, and E is the integral of
x**2 over a period. A0 and E0 belong to the motion without friction. A1 and E1 belong to "stick-slip not considered"
(`rk4-sign`), and A2 and E2 to stick-slip considered. A_D is
|A1 - A2|/A2, and E_D is defined in the same way. The paper leaves these details of the dichotomy open:

- *v kept* or *v zero*: in stick the velocity of the body is kept, or set to zero.
- *release step* or *located*: the release is at the next step, or when the applied force reaches the limit.
- *force by step* or *by stage*: the direction of friction is chosen once per step, or at each stage of RK4. For A1
  these choices are called *sign by step* and *sign by stage*.
- *full-step* or *rest-of-step*: the step after an event is a full step, or the rest of the step of the event.

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
            "The table gives the error of the amplitude in per cent. This error is the mean over the last periods of a",
            "run. The brackets give the least and the greatest value. Only one of the open details has a "
            "large effect. This detail is the velocity in",
            "stick, which Eq. 4 keeps at its value after the dichotomy. If the motion does not repeat, the amplitude",
            "is a range.",
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
            f"The exact steady motion was computed on {points[0]} x {points[1]} points. The difference "
            "between the states at the beginning and at the end of a period is "
            f"{facts['median residual of periodicity']:.0e} (median), and at most "
            f"{facts['largest residual of periodicity']:.0e}. Den Hartog's boundary is a closed form that "
            "separates",
            f"points with stops from points without stops. {disagree} points are on the wrong side of this "
            "boundary. At points without",
            "stops, the closed form of the amplitude agrees with the run to",
            f"{facts['largest deviation of the closed form where it holds']:.0e}. At low frequencies there are up to",
            f"{facts['most stops per period']} stops per period.",
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
            "*At grey points the body does not move, or the simpler model has no answer.*",
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
            "The runs start on the exact orbit. A setting is sufficient if the amplitude of each of the last forty",
            f"periods is within 1 % of the exact amplitude. The steps have h0 up to {STEPS[-1]}. The",
            f"smallest eps_v is {EPS[-1]:.1e} m/s.",
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
            f"The map has the steady amplitude and energy at {study.timed_map.side} x {study.timed_map.side} "
            f"points. Each value is from a run of {facts['settling']}. All methods use the same",
            "threads in the same run. The time includes all costs of a point. `exact` runs the whole map as one",
            "`hs.sweep(..., after=100)`. The other methods run a random sample of the points, one by one, which adds a",
            "millisecond per point. The errors in the table are those of this sample. The reference is the "
            "exact motion after all changes have decayed to",
            'rounding. The method "shooting" is `hs.steady_state`. It finds the orbit without a long run and also',
            "determines its kind.",
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
            f"The study was run in its {study.size.name} size. Runs have {study.size.periods} periods from rest. "
            "A and E are",
            f"those of the last {study.size.last} periods. Without stick the motion does not repeat, so one",
            f"period is not sufficient. {_PAIR} The study ran on {study.workers} threads.",
            "",
            "| part | seconds |",
            "| --- | --- |",
            *(f"| {name} | {value:g} |" for name, value in study.seconds.items()),
        ]
    )
