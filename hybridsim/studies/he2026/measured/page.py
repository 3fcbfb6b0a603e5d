"""This module writes the page of the study: every claim with its verdict, figure and reason, and further results."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from typing import Any

from hybridsim.studies.he2026.measured.he2026 import Study
from hybridsim.studies.he2026.measured.required_settings import EPS, STEPS
from hybridsim.studies.he2026.measured.settings import SOURCE, STEPS_PER_PERIOD
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
    "figure 4": "Each line is a case. Solid lines are for different r, dashed lines for different N, and "
    "dotted lines for different F0. The black line is for F0/N = 0.55, r = 0.64, where the "
    "map of Figure 10 has large values.",
    "figure 5": (
        "The curves show A and E of the same cases over eps_v. The vertical line marks the published eps_v."
    ),
    "figure 6": "The left panel shows the increase of the run time. The right panel shows the increase of "
    "the number of evaluations of the right-hand side.",
    "figure 7": "The grey mark shows the claimed increase of 225 %.",
    "figure 10": "In the first two columns, A2 is computed by the published method. "
    "The velocity in stick is kept or set to zero. In the last column A2 is exact.",
    "figure 11": "The maps correspond to those of Figure 10, with E_D in place of A_D.",
    "figure 12": (
        "Without stick the friction force jumps between its limits. If the velocity is kept in "
        "stick, the body creeps."
    ),
    "figure 13": "The body never sticks in this case, so the motions in all columns are equal.",
    "text": "The deviation of the method without stick is of first order in the step. For small steps the "
    "computed motion approaches the motion with stick.",
}
_WIDTH = 120


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

When must a model include stick-slip? The paper of He et al. answers this question by a map, but the values of this
map depend on the size of the step. The paper is {SOURCE}. The map shows the deviation between a method without stick
and a method with stick. For small steps, the motion that is computed without stick approaches the motion with stick.
If the step decreases, the values of the map therefore decrease too. The motion, its spectrum, and the reduction to
two parameters are right in the paper. The run times in the paper are those of one implementation.

The system is an oscillator with Coulomb friction and harmonic forcing (model `dfcs`). This study computes every
figure of the paper again. The integrator `rk4-dichotomy` is our implementation of the published method with
stick-slip. The integrator `rk4-sign` is our implementation of the method without stick-slip. The paper leaves
details of the methods open. A *reading* is one choice of these details. The study compares the results of the
readings with the exact motion, which `exact` computes. The sections after the claims give results that do not
depend on a step. These sections show which motions stop, and for how long. The sections also show the errors of
models without stops.

| figure | claim | verdict |
| --- | --- | --- |
{rows}

**Terms.** F0 is the amplitude of the forcing, N the normal load, and r the frequency ratio omega/omega_n. The
number of steps per period T of the forcing is h0. Below the speed eps_v, `rk4-dichotomy` treats the velocity as
zero. A is half the range of x in a period, and E is the integral of x**2 over a period. A0 and E0 are the values of
A and E without friction. A1 and E1 are the values of the method without stick (`rk4-sign`). A2 and E2 are the
values of the method with stick (`rk4-dichotomy`). A_D is the deviation |A1 - A2|/A2, and E_D is |E1 - E2|/E2. The
paper leaves these details of the methods open:

- *v kept* or *v zero*: in stick the velocity of the body is kept, or set to zero.
- *release step* or *located*: the release is at the next step, or at the instant at which the applied force reaches
  the limit of friction.
- *force by step* or *by stage*: the direction of friction is chosen once per step, or at each stage of RK4. For the
  method without stick, these two choices are called *sign by step* and *sign by stage*.
- *full-step* or *rest-of-step*: the step after an event has the full length, or only completes the interrupted
  step.

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
            "The table gives the error of the amplitude in per cent, as the mean over the last periods of a run. The",
            "least and the greatest error of these periods are in brackets. Of the details that the paper leaves",
            "open, only the velocity in stick has a large effect. Eq. 4 of the paper keeps this velocity at its value",
            "after the dichotomy.",
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
            f"The exact steady motion was computed at {points[0]} x {points[1]} points (r, F0/N). In the "
            "median, the displacements at the beginning and at the end of a period differ by "
            f"{facts['median residual of periodicity']:.0e} of the amplitude. The largest of these "
            f"differences is {facts['largest residual of periodicity']:.0e}. A closed form by Den Hartog "
            "gives the boundary between motions with stops and motions without stops. The exact motion "
            f"disagrees with this boundary at {disagree} points. For motions without stops, Den Hartog's "
            "closed form of the amplitude agrees with the exact motion to "
            f"{facts['largest deviation of the closed form where it holds']:.0e}. At low frequencies there "
            f"are up to {facts['most stops per period']} stops per period.",
            "",
            f"![stick fraction, stops per period, amplitude]({image('stick')})",
            "",
            "A simpler model is adequate at a point if the error of its amplitude is at most 1 %. The share of "
            "adequate points among all points with motion is: "
            + ", ".join(f"{name} {_percent(share)}" for name, share in within.items())
            + ". Den Hartog's closed form needs no simulation. The error of this form is below 1 % if less than "
            + _percent(facts["stick fraction below which the closed form without stops is within 1 %"])
            + " of the period is stick. The error is below 5 % if less than "
            + _percent(facts["stick fraction below which the closed form without stops is within 5 %"])
            + " of the period is stick.",
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
            "Which step and which eps_v are sufficient for an error of 1 %? The runs start on the exact periodic",
            "motion. A setting is sufficient if the amplitude of each of the last forty periods is within 1 % of the",
            f"exact amplitude. For the methods without stick, h0 is varied up to {STEPS[-1]}. For the methods with",
            f"stick, eps_v is varied down to {EPS[-1]:.1e} m/s, with h0 = {STEPS_PER_PERIOD}.",
            "",
            "| method | share of the map at which the published setting is sufficient | "
            "share at which no setting is sufficient |",
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
            f"points. Each value is from a run of {facts['settling']}. All methods use the same number of threads.",
            "The time per point is the elapsed time divided by the number of points. `exact` runs the whole map as one",
            "`hs.sweep(..., after=100)`. The other methods run only a random sample of the points, one by one. A",
            "separate call takes about a millisecond more than a point of a sweep. All errors in the table are those",
            "at the points of the sample. The reference is the exact steady motion.",
            'The method "shooting" is `hs.steady_state`, which computes the periodic motion without a long run.',
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
            f"This page shows the {study.size.name} size of the study, on {study.workers} threads. Runs have "
            f"{study.size.periods} periods from rest. A and E are means over the last {study.size.last} periods,",
            "because without stick the periods are not equal.",
            "",
            "| part | seconds |",
            "| --- | --- |",
            *(f"| {name} | {value:g} |" for name, value in study.seconds.items()),
        ]
    )
