"""This module judges the paper's conclusion that the stick fraction determines the deviation."""

from __future__ import annotations

from typing import Any

from hybridsim.studies.he2026.measured.deviation import EXACT, Maps, combinations, pair_name
from hybridsim.studies.he2026.measured.settings import SIGNS, STEPS_PER_PERIOD
from hybridsim.studies.he2026.measured.step_study import STEPS, StepStudy
from hybridsim.studies.he2026.measured.truth import Truth
from hybridsim.studies.he2026.measured.verdicts import Claim, Verdict

_STRONG = 0.5  # a larger rank correlation counts as a correlation


def claim(maps: Maps, study: StepStudy, truth: Truth) -> Claim:
    """Judge the conclusion that the stick fraction determines the deviation."""
    from scipy.stats import spearmanr

    def row(pair: tuple[str, str]) -> dict[str, Any]:
        deviation = maps.deviation("A", *pair)
        return {
            "rank correlation of A_D with the stick share": float(
                spearmanr(maps.stick.ravel(), deviation.ravel()).statistic
            ),
            "largest A_D where the stick share is below 5 %": float(deviation[maps.stick < 0.05].max()),
        }

    key = "rank correlation of A_D with the stick share"
    rows = {pair_name(pair): row(pair) for pair in combinations()}
    ours = {name: value for name, value in rows.items() if not name.endswith(EXACT)}
    closest = max(ours, key=lambda name: ours[name][key])
    strong = ours[closest][key] >= _STRONG
    shrinks = study.shrinks("A")
    verdict = Verdict.SHAPE if strong and shrinks else Verdict.REPRODUCED if strong else Verdict.NOT
    first = STEPS.index(STEPS_PER_PERIOD)
    stage = study.along(SIGNS[-1].name, "A")
    one, five = truth.harmless(0.01), truth.harmless(0.05)
    why = (
        f"A_D grows with the stick fraction (rank correlation {ours[closest][key]:.2f}), but it also "
        "depends on the step. If only the step decreases, the stick fractions do not change, but A_D "
        f"decreases from {100 * stage[first]:.2g} % to {100 * stage[-1]:.2g} %. Den Hartog's closed form "
        "assumes a motion without stops and needs no step. The error of its amplitude is below 1 % if the "
        f"stick fraction is below {100 * one:.2g} %. The error is below 5 % if the stick fraction is below "
        f"{100 * five:.2g} %."
    )
    return Claim(
        "text",
        "",
        "the deviation depends on the stick fraction, which is the share of the period in stick. If this "
        "fraction is small, stick-slip need not be considered",
        {"deviation": "grows with the share of the period in stick"},
        ours,
        closest,
        {
            **{name: value for name, value in rows.items() if name.endswith(EXACT)},
            "closed form without stops: within 1 % below the stick share": one,
            "closed form without stops: within 5 % below the stick share": five,
        },
        verdict,
        why,
        study.to_plain("A") if shrinks else {},
    )
